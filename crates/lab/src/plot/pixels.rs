//! Pictures as pixels, so that one can be laid over another, turned.

use std::io::Cursor;

/// Bytes of a pixel: red, green, blue and opacity.
const CHANNELS: usize = 4;

/// A picture: rows from the top, four bytes a pixel.
pub(super) struct Pixels {
    width: usize,
    height: usize,
    bytes: Vec<u8>,
}

impl Pixels {
    /// The picture in a PNG file of eight bits a channel, red, green, blue and opacity.
    ///
    /// # Errors
    /// It is none, in words.
    pub(super) fn decode(file: &[u8]) -> Result<Self, String> {
        let mut reader = png::Decoder::new(Cursor::new(file)).read_info().map_err(|error| error.to_string())?;
        let mut bytes = vec![0; reader.output_buffer_size().ok_or("the picture is too large")?];
        let info = reader.next_frame(&mut bytes).map_err(|error| error.to_string())?;
        if (info.color_type, info.bit_depth) != (png::ColorType::Rgba, png::BitDepth::Eight) {
            return Err(format!("a picture of four channels is expected, not {:?}", info.color_type));
        }
        Ok(Self { width: info.width as usize, height: info.height as usize, bytes })
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// The encoder's error, in words.
    pub(super) fn encode(&self) -> Result<Vec<u8>, String> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(&self.bytes).and_then(|()| writer.finish()))
            .map_err(|error| error.to_string())?;
        Ok(file)
    }

    /// The pixel in a column and a row.
    #[cfg(test)]
    pub(super) fn at(&self, x: usize, y: usize) -> &[u8] {
        &self.bytes[(y * self.width + x) * CHANNELS..][..CHANNELS]
    }

    /// Darkens this picture, as ink does, by what stands on a white `sheet` that is turned a quarter to the left.
    pub(super) fn print_turned(&mut self, sheet: &Self) {
        let white = [u8::MAX; CHANNELS];
        for (row, pixels) in sheet.bytes.chunks_exact(sheet.width * CHANNELS).enumerate().take(self.width) {
            for (column, ink) in pixels.chunks_exact(CHANNELS).enumerate().take(self.height) {
                if ink == white {
                    continue;
                }
                let at = ((self.height - 1 - column) * self.width + row) * CHANNELS;
                for (under, ink) in self.bytes[at..at + CHANNELS - 1].iter_mut().zip(ink) {
                    *under = (u16::from(*under) * u16::from(*ink) / u16::from(u8::MAX)) as u8;
                }
            }
        }
    }
}
