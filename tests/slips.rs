//! Sequences in which the count of cells slipped in silence, or was begun anew for no need, each before something was changed that keeps its kind from it.

#[path = "../examples/counting/sequence.rs"]
#[allow(dead_code)]
mod sequence;

use sequence::{KINDS, Tally, run, sequence};

/// Frames of a sequence: its path depends on how long it is.
const FRAMES: u32 = 50;

/// Follows the sequence; no slip, and no more said to be in doubt than one frame in so many: to say nothing would be no answer. Two frames of 7517 are refused, which makes its gap.
fn counts(name: &str, seed: u64, part: u32) {
    let kind = KINDS.iter().position(|kind| *kind == name).expect("a kind");
    let mut tally = Tally::default();
    run(&sequence(kind, FRAMES, seed), 1, &mut tally).expect("a simulated sequence");
    assert_eq!((tally.frames, tally.silent), (FRAMES, 0), "{name} {seed}: {tally:?}");
    assert!(tally.refused <= 2 && tally.flagged <= FRAMES / part, "{name} {seed}: {tally:?}");
}

#[test]
fn names_that_are_right_are_not_renamed() {
    // The vote refuted right names by 6.4 and by 5.1 deviations; since waves are cut it no longer does.
    counts("bare", 7012, 5);
    counts("fish", 7119, 5);
}

#[test]
fn what_a_velocity_is_off_by_over_a_gap_is_not_taken_for_that_of_a_frame() {
    // Off by a cell a frame, and by two over the frame without a pose; settled as if by one there too.
    // The net behind has aliases that are beyond chance as well: eleven frames, one more than before these were heeded.
    counts("behind", 7517, 4);
}

#[test]
fn cells_are_counted_through_frames_without_a_pose() {
    // The normal is too doubtful for a pose in every fifth frame, the lattice is not.
    let kind = KINDS.iter().position(|kind| *kind == "far").expect("a kind");
    let mut tally = Tally::default();
    run(&sequence(kind, FRAMES, 8008), 1, &mut tally).expect("a simulated sequence");
    assert!(tally.refused >= 3, "without gaps nothing is shown: {tally:?}");
    assert_eq!((tally.silent, tally.flagged), (0, 0), "{tally:?}");
}

#[test]
fn the_lattice_of_a_net_behind_does_not_vote() {
    // It moved past at nearly a whole cell a frame; after 37 frames in doubt the vote took it for the net's own motion, and was followed.
    counts("behind", 7333, 5);
}

#[test]
fn the_aliases_of_a_net_behind_do_not_settle_a_doubt() {
    // Seven frames added up to 11.3 deviations for one of them, and to 7.4 for the next; its doubt lasts.
    counts("behind", 9012, 2);
}

#[test]
fn a_frame_that_vote_and_velocity_name_otherwise_is_not_recognised_again() {
    // Four frames later its place in the map renamed the count by a cell.
    counts("fish", 7342, 5);
}
