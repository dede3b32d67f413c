//! The computation on tiny images: frames, calls, circles, interrupts, limits. Each rule is seen to fail.

mod step;
mod tiny;

use super::frame::{MASK, UNMASK};
use super::total::sum;
use tiny::{BACK, Call, Data, HAND, Jump, NEVER, POP, PUSH, Piece, REAL, Tiny, board, code, framed, main, priorities};

fn bytes(tiny: &Tiny, name: &str) -> u32 {
    tiny.deepest(name).expect("a depth").bytes
}

fn refusal<T>(result: anyhow::Result<T>) -> String {
    match result {
        Ok(_) => panic!("it was not refused"),
        Err(error) => format!("{error:#}"),
    }
}

#[test]
fn a_way_is_the_sum_of_what_is_in_use_at_each_call() {
    let tiny = Tiny::default()
        // A call, then more stack, then a smaller call: the first is deeper.
        .with("outer", vec![code(&[PUSH]), Call("inner"), code(&[0xB081]), Call("small"), code(&[0xB001, POP])])
        .with("inner", framed(200, &["small"]))
        .with("small", framed(16, &[]));
    assert_eq!(bytes(&tiny, "small"), 24);
    assert_eq!(bytes(&tiny, "inner"), 208 + 24);
    let way = tiny.deepest("outer").expect("a depth");
    assert_eq!(way.bytes, 8 + 208 + 24);
    let stops: Vec<(&str, u32)> = way.stops.iter().map(|stop| (stop.function.as_str(), stop.bytes)).collect();
    assert_eq!(stops, [("outer", 8), ("inner", 208), ("small", 24)]);
}

#[test]
fn a_jump_to_another_function_leaves_nothing_behind() {
    let tiny = Tiny::default()
        // push {r7, lr}; sub sp, #64; add sp, #64; pop.w {r7, lr}; b.w inner
        .with("outer", vec![code(&[PUSH, 0xB090, 0xB010, 0xE8BD, 0x4080]), Jump("inner")])
        .with("inner", framed(40, &[]));
    assert_eq!(bytes(&tiny, "outer"), 72, "its own frame, not on top of it");
    let tiny = tiny.with("inner", framed(80, &[]));
    assert_eq!(bytes(&tiny, "outer"), 88, "the frame of the other alone");
}

#[test]
fn a_bridge_leads_where_its_constant_says() {
    const BRIDGE: &str = "__Thumbv7ABSLongThunk_inner";
    let tiny =
        Tiny::default().with("outer", framed(16, &[BRIDGE])).with("inner", framed(120, &[])).with(BRIDGE, vec![]);
    // movw r12, #(inner | 1); movt r12, #0; bx r12
    let low = (tiny.address("inner") | 1) as u16;
    let tiny = tiny.with(BRIDGE, vec![code(&[0xF240, 0x0C00 | low, 0xF2C0, 0x0C00, 0x4760])]);
    assert_eq!(bytes(&tiny, "outer"), 24 + 128);
}

#[test]
fn both_sides_of_a_branch_and_every_entry_of_a_table_count() {
    let tiny = Tiny::default()
        // push; cbz r0, the second call; bl small; pop; bl inner; pop
        .with("either", vec![code(&[PUSH, 0xB110]), Call("small"), code(&[POP]), Call("inner"), code(&[POP])])
        // push; tbb [pc, r0]; two entries; bl small; pop; bl inner; pop
        .with(
            "table",
            vec![
                code(&[PUSH, 0xE8DF, 0xF000]),
                Data(vec![0x0401]),
                Call("small"),
                code(&[POP]),
                Call("inner"),
                code(&[POP]),
            ],
        )
        .with("inner", framed(200, &[]))
        .with("small", framed(16, &[]));
    assert_eq!(bytes(&tiny, "either"), 8 + 208);
    assert_eq!(bytes(&tiny, "table"), 8 + 208);
}

#[test]
fn a_way_back_on_a_condition_goes_on_with_the_frame() {
    let tiny = Tiny::default()
        // push; sub sp, #64; itt eq; addeq sp, #64; popeq; bl inner; add sp, #64; pop
        .with("early", vec![code(&[PUSH, 0xB090, 0xBF04, 0xB010, POP]), Call("inner"), code(&[0xB010, POP])])
        // push; itet eq; popeq.w {r7, lr}; nopne; b.weq inner; pop
        .with("late", vec![code(&[PUSH, 0xBF0A, 0xE8BD, 0x4080, 0xBF00]), Jump("inner"), code(&[POP])])
        // push; sub sp, #64; it ne; addne sp, #64; it ne; popne; bl inner; add sp, #64; pop
        .with("twice", vec![code(&[PUSH, 0xB090, 0xBF18, 0xB010, 0xBF18, POP]), Call("inner"), code(&[0xB010, POP])])
        .with("inner", framed(200, &[]));
    assert_eq!(bytes(&tiny, "twice"), 8 + 64 + 208);
    assert_eq!(bytes(&tiny, "early"), 8 + 64 + 208);
    assert_eq!(bytes(&tiny, "late"), 208);
}

#[test]
fn a_table_elsewhere_is_found_by_the_register_that_points_to_it() {
    let tiny = Tiny::default()
        // push; adr r2, the table; tbb [r2, r0]; bl small; pop; bl inner; pop; two entries (zero: behind the
        // instruction)
        .with(
            "table",
            vec![
                code(&[PUSH, 0xA204, 0xE8D2, 0xF000]),
                Call("small"),
                code(&[POP]),
                Call("inner"),
                code(&[POP]),
                Data(vec![0x0300]),
            ],
        )
        .with("inner", framed(200, &[]))
        .with("small", framed(16, &[]));
    assert_eq!(bytes(&tiny, "table"), 8 + 208);
}

#[test]
fn what_fills_up_a_table_leads_nowhere() {
    let tiny = Tiny::default()
        // push; adr r2, the table; tbb [r2, r0]; nop that aligns a constant; the constant; two entries and two bytes
        // that are none; bl small; pop; bl inner; pop
        .with(
            "table",
            vec![
                code(&[PUSH, 0xA202, 0xE8D2, 0xF000, 0xBF00]),
                Data(vec![0x1234, 0x0704, 0x0000]),
                Call("small"),
                code(&[POP]),
                Call("inner"),
                code(&[POP]),
            ],
        )
        .with("inner", framed(200, &[]))
        .with("small", framed(16, &[]));
    assert_eq!(bytes(&tiny, "table"), 8 + 208);
}

#[test]
fn large_frames_by_a_register_are_read() {
    // push; movw r12, #61440; movt r12, #1; sub.w sp, sp, r12; movw, movt, add sp, r12; pop
    let moved = |by: &[u16]| {
        let constant = [0xF24F, 0x0C00, 0xF2C0, 0x0C01];
        vec![code(&[PUSH]), code(&constant), code(by), code(&constant), code(&[0x44E5, POP])]
    };
    let tiny = Tiny::default().with("large", moved(&[0xEBAD, 0x0D0C]));
    assert_eq!(bytes(&tiny, "large"), 8 + 0x1_F000);
}

#[test]
fn an_aligned_frame_counts_what_aligning_may_cost_and_comes_back_by_the_frame_pointer() {
    // push {r4, r6, r7, lr}; add r7, sp, #8; sub sp, #64; mov r4, sp; bfc r4, #0, #5; mov sp, r4;
    // sub.w r4, r7, #8; mov sp, r4; pop {r4, r6, r7, pc}
    let aligned = [0xB5D0, 0xAF02, 0xB090, 0x466C, 0xF36F, 0x0404, 0x46A5, 0xF1A7, 0x0408, 0x46A5, 0xBDD0];
    let tiny = Tiny::default().with("aligned", vec![code(&aligned)]);
    assert_eq!(bytes(&tiny, "aligned"), 16 + 64 + 28);
}

#[test]
fn a_stack_pointer_that_cannot_be_followed_is_refused_by_name() {
    for (halves, said) in [
        // push; msr msp, r0; pop
        (&[PUSH, 0xF380, 0x8808, POP][..], "in a way nobody can read"),
        // push; sub.w sp, sp, r0 (an argument); pop
        (&[PUSH, 0xEBAD, 0x0D00, POP], "by a number nobody can read"),
        // push; mov sp, r0; pop
        (&[PUSH, 0x4685, POP], "in a way nobody can read"),
        // push; sub sp, #8; pop
        (&[PUSH, 0xB082, POP], "with 8 bytes left on the stack"),
        // pop {r7, pc}
        (&[POP], "above where it began"),
        // push; b . - 2: pushes for ever
        (&[PUSH, 0xE7FD], "it begins anew"),
        // nop; push; b to the push
        (&[0xBF00, PUSH, 0xE7FD], "is reached with"),
        // it eq; pusheq; bx lr
        (&[0xBF08, PUSH, BACK], "is reached with"),
        // ldr.w pc, [r0]
        (&[0xF8D0, 0xF000], "nobody can read where it goes on"),
        // bx lr; push {r7, lr}
        (&[BACK, PUSH, POP], "is not reached"),
    ] {
        let said_now = refusal(Tiny::default().with("strange", vec![code(halves)]).deepest("strange"));
        assert!(said_now.contains("strange") && said_now.contains(said), "{halves:x?}: {said_now}");
    }
}

#[test]
fn circles_are_refused_with_their_functions() {
    let tiny = Tiny::default()
        .with("first", framed(8, &["second"]))
        .with("second", framed(8, &["third"]))
        .with("third", framed(8, &["second"]));
    let said = refusal(tiny.deepest("first"));
    assert!(said.contains("circle: second -> third"), "{said}");
    assert!(refusal(Tiny::default().with("own", framed(8, &["own"])).deepest("own")).contains("circle: own"));
}

#[test]
fn a_call_into_the_middle_of_nothing_is_refused() {
    // bl to the second half of itself
    let said = refusal(Tiny::default().with("astray", vec![code(&[PUSH, 0xF000, 0xF840, POP])]).deepest("astray"));
    assert!(said.contains("astray calls") && said.contains("where no function begins"), "{said}");
}

/// push; blx r3; pop
fn through_pointer() -> Vec<Piece> {
    vec![code(&[PUSH, 0x4798, POP])]
}

/// A function that makes the address of the function at this place.
fn making(address: u32) -> Vec<Piece> {
    making_number(address | 1)
}

/// movw r0; movt r0; bx lr
fn making_number(address: u32) -> Vec<Piece> {
    let second = (address >> 8 & 7) << 12 | address & 0xFF;
    let first = 0xF240 | (address >> 11 & 1) << 10;
    vec![code(&[first as u16, second as u16, 0xF2C0, 0x0000, BACK])]
}

#[test]
fn a_call_through_a_pointer_may_lead_to_every_function_whose_address_is_made_on_the_way() {
    let tiny = Tiny::default()
        .with("outer", vec![code(&[PUSH]), Call("maker"), Call("caller"), code(&[POP])])
        .with("caller", through_pointer())
        .with("taken", framed(80, &[]))
        .with("other", framed(800, &[]))
        .with("maker", vec![code(&[BACK])]);
    assert!(refusal(tiny.deepest("outer")).contains("nothing before it can have made"));
    let address = tiny.address("taken");
    let tiny = tiny.with("maker", making(address));
    assert_eq!(bytes(&tiny, "outer"), 16 + 88);
    assert!(
        refusal(tiny.deepest("caller")).contains("nothing before it can have made"),
        "nothing it reaches makes one"
    );
}

#[test]
fn functions_in_data_whose_address_is_made_may_be_behind_a_pointer() {
    let tiny = Tiny::default()
        .with("outer", vec![code(&[PUSH]), Call("maker"), Call("caller"), code(&[POP])])
        .with("caller", through_pointer())
        .with("near", framed(16, &[]))
        .with("far", framed(80, &[]))
        .with("other", framed(800, &[]))
        .with("maker", vec![])
        .with("stranger", vec![]);
    let [near, far, other] = ["near", "far", "other"].map(|name| tiny.address(name) | 1);
    let begin = tiny.clone().with_data(&[]).1;
    // Three pieces: one that leads to the last, one that only a stranger knows, and the last.
    let tiny = tiny.with_data(&[near, begin + 12, other, far]).0.with("stranger", making_number(begin + 8));
    assert_eq!(bytes(&tiny.clone().with("maker", making_number(begin)), "outer"), 16 + 88);
    assert_eq!(bytes(&tiny.with("maker", making_number(begin + 8)), "outer"), 16 + 808);
}

#[test]
fn instructions_that_look_like_an_address_end_no_piece_of_data() {
    let tiny = Tiny::default()
        .with("lookalike", vec![code(&[0, 0, BACK])])
        .with("outer", vec![code(&[PUSH]), Call("maker"), Call("caller"), code(&[POP])])
        .with("caller", through_pointer())
        .with("taken", framed(80, &[]))
        .with("maker", vec![]);
    let taken = tiny.address("taken") | 1;
    let (tiny, begin) = tiny.with_data(&[u32::MAX, taken]);
    let address = begin + 4;
    let tiny = tiny.with("lookalike", vec![code(&[address as u16, (address >> 16) as u16, BACK])]);
    assert_eq!(bytes(&tiny.with("maker", making_number(begin)), "outer"), 16 + 88);
}

#[test]
fn a_call_of_one_kind_leads_to_that_kind_alone_and_as_deep_as_is_listed() {
    let text = "<x as core::fmt::Debug>::fmt";
    let tiny = Tiny::default()
        .with("core::fmt::write", through_pointer())
        .with(text, framed(32, &["core::fmt::write"]))
        .with("other", framed(800, &[]));
    let (first, second) = (tiny.address(text), tiny.address("other"));
    let both = vec![code(&[PUSH]), Call("maker"), Call("other maker"), Call("core::fmt::write"), code(&[POP])];
    let tiny = tiny.with("maker", making(first)).with("other maker", making(second)).with("both", both);
    // Six texts inside one another, by the list.
    assert_eq!(bytes(&tiny, "both"), 8 + 6 * (8 + 40) + 8);
}

#[test]
fn what_a_function_behind_a_pointer_makes_may_be_behind_the_next() {
    let (outer, inner) = ("<a as core::fmt::Debug>::fmt", "<b as core::fmt::Debug>::fmt");
    let tiny = Tiny::default()
        .with("both", vec![code(&[PUSH]), Call("maker"), Call("core::fmt::write"), code(&[POP])])
        .with("core::fmt::write", through_pointer())
        .with(inner, framed(400, &[]))
        .with("other maker", vec![])
        .with(outer, framed(32, &["other maker", "core::fmt::write"]));
    let (first, second) = (tiny.address(outer), tiny.address(inner));
    let tiny = tiny.with("maker", making(first)).with("other maker", making(second));
    // Five of the outer and the inner.
    assert_eq!(bytes(&tiny, "both"), 8 + 5 * (8 + 40) + 8 + 408);
}

#[test]
fn texts_that_hand_out_each_other_deeper_than_listed_are_refused() {
    const TEXTS: [&str; 7] = [
        "<a as core::fmt::Debug>::fmt",
        "<b as core::fmt::Debug>::fmt",
        "<c as core::fmt::Debug>::fmt",
        "<d as core::fmt::Debug>::fmt",
        "<e as core::fmt::Debug>::fmt",
        "<f as core::fmt::Debug>::fmt",
        "<g as core::fmt::Debug>::fmt",
    ];
    let chain = |texts: &[&'static str], last: &'static str| {
        let mut tiny = board(HAND);
        for text in TEXTS {
            tiny = tiny.with(text, vec![code(&[BACK])]);
        }
        let mut next = last;
        for text in texts.iter().rev() {
            let address = tiny.address(next);
            tiny = tiny.with(text, making(address));
            next = text;
        }
        let address = tiny.address(next);
        tiny.with("stranger", making(address)).depth(HAND)
    };
    chain(&TEXTS[..4], TEXTS[4]).expect("five and one that passes them on are six");
    let said = refusal(chain(&TEXTS[..5], TEXTS[5]));
    assert!(said.contains("<a as core::fmt::Debug>::fmt") && said.contains("may be 6 inside one another"), "{said}");
    assert!(refusal(chain(&TEXTS[..2], TEXTS[0])).contains("in a circle"));
}

#[test]
fn start_and_service_are_told_apart_and_interrupts_come_on_top() {
    let tiny = board(HAND);
    let depth = tiny.depth(HAND).expect("a depth");
    let interrupts = 4 * (36 + 48);
    assert_eq!(depth.in_service(), 8 + 108 + interrupts);
    assert_eq!(depth.at_start(), 8 + 8 + 408, "deeper than what waits until interrupts are unmasked");
    assert_eq!(depth.faults(), [""; 0]);
    let idle = tiny.clone().with("idle", framed(1000, &[])).depth(HAND).expect("a depth");
    assert_eq!(idle.at_start(), depth.at_start(), "what runs later is not the start");
    assert_eq!(idle.in_service(), 8 + 1008 + interrupts);
    let deep = tiny.clone().with("deep", framed(8, &[])).depth(HAND).expect("a depth");
    assert_eq!(deep.at_start(), 8 + 8 + interrupts, "interrupts on top of what unmasked them");
    // What may end there: a panic in the slot, a fault above everything.
    let fault = 36 + 48;
    assert_eq!(sum(&depth.end).max(1), (8 + 108 + interrupts + fault).max(8 + 8 + 408 + fault));
}

#[test]
fn handlers_of_one_level_do_not_add_up_and_those_of_two_do() {
    let service = |tiny: Tiny| tiny.depth(HAND).expect("a depth").in_service();
    let none = service(board(HAND));
    assert_eq!(service(board(HAND).with("CAN_RECEIVE", framed(60, &[]))), none + 20);
    assert_eq!(
        service(board(HAND).with("CAN_RECEIVE", framed(60, &[])).with("CAN_TRANSMIT", framed(60, &[]))),
        none + 20
    );
    assert_eq!(
        service(board(HAND).with("CAN_RECEIVE", framed(60, &[])).with("SLOT_TIMER", framed(60, &[]))),
        none + 40
    );
}

#[test]
fn a_panic_counts_with_its_last_words_once() {
    let tiny = board(HAND).with("SLOT_TIMER", framed(40, &["rust_begin_unwind"]));
    let depth = tiny.depth(HAND).expect("a depth");
    let below = 8 + 108 + 2 * 84;
    assert_eq!(depth.in_service(), below + 36 + 48 + 8 + 84, "the end of a panic without what it calls");
    let depth = tiny.with("deep", framed(2000, &[])).depth(HAND).expect("a depth");
    assert_eq!(sum(&depth.end), below + 36 + 48 + 8 + 2008);
}

#[test]
fn a_handler_that_no_row_lists_is_refused_and_so_is_a_row_without_handler() {
    let said = refusal(board(HAND).with("USART3", framed(8, &[])).depth(HAND));
    assert!(said.contains("USART3") && said.contains("has no priority"), "{said}");
    let mut tiny = board(HAND);
    tiny.functions.retain(|(name, _)| *name != "BUS_WIRE");
    assert!(refusal(tiny.depth(HAND)).contains("BUS_WIRE"));
    assert!(refusal(board(HAND).depth("arduino")).contains("arduino"));
}

#[test]
fn a_priority_that_is_not_the_one_in_the_table_is_refused() {
    let mut other = priorities(HAND);
    other[0] = 3;
    let said = refusal(board(HAND).with("main", main(&other)).depth(HAND));
    assert!(said.contains("DISPATCH_SESSION has priority 2") && said.contains("but 3 in the image"), "{said}");
    let said = refusal(board(HAND).with("main", main(&other[..0])).depth(HAND));
    assert!(said.contains("none that can be read"), "{said}");
}

#[test]
fn a_panic_that_leaves_interrupts_on_is_refused() {
    let tiny = board(HAND).with("rust_begin_unwind", vec![code(&[PUSH]), Call("deep"), code(&[MASK, NEVER])]);
    assert!(refusal(tiny.depth(HAND)).contains("does not mask interrupts"));
    // The one it calls may do it.
    let tiny = board(HAND)
        .with("rust_begin_unwind", vec![code(&[PUSH]), Call("stranger"), code(&[NEVER])])
        .with("stranger", vec![code(&[PUSH, PUSH, MASK]), Call("deep"), code(&[NEVER])])
        .with("SLOT_TIMER", framed(40, &["rust_begin_unwind"]));
    let depth = tiny.depth(HAND).expect("a depth");
    assert_eq!(depth.in_service(), 8 + 108 + 2 * 84 + 36 + 48 + 8 + 16 + 84);
}

#[test]
fn a_start_or_a_service_that_is_too_deep_fails() {
    // 16 KiB: at most 9830 B at start, 6553 B in service.
    let start = |bytes| board(HAND).with("deep", framed(bytes, &["idle"])).depth(HAND).expect("a depth");
    assert_eq!(start(4000).faults(), [""; 0]);
    let three = board(HAND)
        .with("deep", framed(4000, &["stranger"]))
        .with("stranger", framed(4000, &["idle"]))
        .with("idle", framed(2000, &[]));
    let said = three.depth(HAND).expect("a depth").faults().join("; ");
    assert!(said.contains("the start takes 10040 B") && said.contains("60 %"), "{said}");
    let service = board(HAND).with("idle", framed(4000, &["stranger"])).with("stranger", framed(2500, &[]));
    let said = service.depth(HAND).expect("a depth").faults().join("; ");
    assert!(said.contains("the service takes") && said.contains("40 %"), "{said}");
}

#[test]
fn a_frame_larger_than_the_guard_fails_where_there_is_a_guard() {
    let large = |name| board(name).with("begin", vec![code(&[PUSH, UNMASK, POP])]).with("idle", begin_large());
    /// push; sub.w sp, sp, #65536; add.w; pop
    fn begin_large() -> Vec<Piece> {
        vec![code(&[PUSH, 0xF5AD, 0x3D80, 0xF50D, 0x3D80, POP])]
    }
    let said = large(REAL).depth(REAL).expect("a depth").faults().join("; ");
    assert!(said.contains("idle has a frame of 65544 B") && said.contains("guard of 65536 B"), "{said}");
    assert!(large(HAND).depth(HAND).expect("a depth").faults().iter().all(|fault| !fault.contains("guard")));
}

#[test]
fn the_emergency_stack_is_counted_by_itself() {
    let depth = board(REAL).depth(REAL).expect("a depth");
    let (size, ways) = depth.other.as_ref().expect("the handler has a stack of its own");
    assert_eq!((*size, sum(ways)), (4096, 408));
    assert_eq!(depth.faults(), [""; 0]);
    let deep = board(REAL).with("deep", framed(4000, &["idle"])).depth(REAL).expect("a depth");
    assert!(deep.faults().iter().any(|fault| fault.contains("of its own stack of 4096 B")), "{:?}", deep.faults());
    let other = board(REAL).with("MemoryManagement", framed(8, &[]));
    assert!(refusal(other.depth(REAL)).contains("does not take the stack"));
}
