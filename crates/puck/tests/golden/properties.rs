//! The property tables against the manufacturer's list, cell by cell, and what must be refused.

use std::collections::BTreeMap;

use puck::hand::HandError;
use puck::{Property, PropertyId, PropertyTable, UnknownFirmware};

/// The list of a vector column such as `Motor_132`; `None` for motors that are too old to be driven.
fn table(column: &str) -> Option<PropertyTable> {
    let (list, version) = column.split_once('_').expect("List_version");
    // No firmware is called 0; the oldest generation starts there.
    let version = version.parse::<i32>().expect("a version").max(1);
    match list {
        "Monitor" => Some(PropertyTable::monitor()),
        "Safety" => Some(PropertyTable::safety(version).expect("known")),
        "Motor" if version < 61 => None,
        "Motor" => Some(PropertyTable::motor(version).expect("known")),
        "ForceTorque" => Some(PropertyTable::force_torque()),
        other => panic!("unknown list {other}"),
    }
}

/// Mnemonics that are another name of a property of the same number.
fn canonical(name: &str) -> &str {
    match name {
        "AP" => "P",
        "TORQ" => "T",
        "B" => "FET0",
        "TENSION" => "FET1",
        other => other,
    }
}

#[test]
fn every_property_number_equals_the_vectors() {
    let by_name: BTreeMap<_, _> = Property::ALL.iter().map(|property| (property.mnemonic(), *property)).collect();
    assert_eq!(by_name.len(), Property::ALL.len(), "a mnemonic occurs twice");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/vectors/property_ids.csv");
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path).expect("the vector file");
    let header = reader.headers().expect("a header").clone();
    let (mut cells, mut refused) = (0, 0);
    let mut named = std::collections::BTreeSet::new();
    for record in reader.records() {
        let record = record.expect("a row");
        let name = canonical(&record[0]);
        let property = by_name[name];
        named.insert(name.to_owned());
        // PEN needs 28 bits although the motor list reserves no second slot for it.
        assert_eq!(property.is_wide(), &record[1] == "1" || property == Property::Pen, "width of {name}");
        for (column, cell) in header.iter().zip(record.iter()).skip(2) {
            let Some(table) = table(column) else {
                refused += 1;
                continue;
            };
            let expected =
                (!cell.is_empty()).then(|| PropertyId::new(cell.parse().expect("a number")).expect("7 bits"));
            let got = table.id(property);
            assert_eq!(got, expected, "{name} in {column}");
            cells += 1;
            if let Some(id) = got {
                let found = table.property(id).expect("the number has a name");
                assert_eq!(table.id(found), Some(id), "{name} in {column}, looked up by number");
            }
        }
    }
    assert_eq!(named.len(), Property::ALL.len(), "the table has properties that the vectors lack");
    // Eight columns are of motors that are too old.
    assert!(cells + refused > 5000 && refused == 8 * (cells + refused) / (header.len() - 2), "{cells} cells compared");
}

#[test]
fn a_version_between_two_generations_uses_the_older_one() {
    let id = |version, property| PropertyTable::motor(version).expect("known").id(property).map(PropertyId::number);
    assert_eq!(id(131, Property::Hold), Some(94));
    assert_eq!(id(132, Property::Hold), Some(77));
    assert_eq!(id(131, Property::En), Some(77));
    assert_eq!(id(200, Property::Ihit), Some(108));
    assert_eq!(id(174, Property::Ihit), None);
}

#[test]
fn unknown_firmware_is_refused() {
    for version in [i32::MIN, -1, 0, 256, i32::MAX] {
        assert_eq!(PropertyTable::motor(version), Err(UnknownFirmware { version }));
        assert_eq!(PropertyTable::safety(version), Err(UnknownFirmware { version }));
    }
    assert_eq!(UnknownFirmware { version: 256 }.to_string(), "no property table for firmware version 256");
    assert_eq!(HandError::Property(Property::Cmd).to_string(), "the hand has no property CMD");
}

#[test]
fn the_constants_agree_with_every_table_a_motor_puck_can_have() {
    // Before 61 the number 42, with which every way out sends zero torque, is a digital output.
    for version in 1..61 {
        assert_eq!(PropertyTable::motor(version), Err(UnknownFirmware { version }));
    }
    for version in 61..=255 {
        let table = PropertyTable::motor(version).expect("known");
        assert_eq!(table.id(Property::T), Some(PropertyId::TORQUE));
        assert_eq!(table.id(Property::P), Some(PropertyId::POSITION));
        assert_eq!(table.id(Property::Mode), Some(PropertyId::MODE));
        assert_eq!(table.id(Property::Stat), Some(PropertyId::STAT));
        assert_eq!(table.id(Property::Role), Some(PropertyId::ROLE));
        assert_eq!(table.id(Property::Vers), Some(PropertyId::VERS));
    }
    let sensor = PropertyTable::force_torque();
    assert_eq!(sensor.id(Property::Ft), Some(PropertyId::FORCE_TORQUE));
    assert_eq!(sensor.id(Property::A), Some(PropertyId::ACCELERATION));
    assert_eq!(PropertyTable::monitor().id(Property::Mode), None, "a monitor has no MODE");
}
