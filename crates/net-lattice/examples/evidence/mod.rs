//! What an estimate stands on, in a line that the examples share.

use net_lattice::LatticeEstimate;

/// Model, polarity, bend, and the evidence of [`net_lattice::Evidence`] by abbreviations that scripts may read.
pub fn line(e: &LatticeEstimate) -> String {
    let v = &e.evidence;
    format!(
        " | {:?} {:?} bend {:.2} sep {:.2} unlike {:.2} bal {:.2} cs {:.1} dis {:.2} hid {:.2} V {:.1} {:.1} V2 {:.1} {:.1} good {:.2} near {:.2} n {} {} margin {:.2} gain {:.4} sr {:.4} st {:.3} C {:.2} {:.2} cg {:.2} {:.2} above {:.2} scatter {:.3} {:.3} bumps {:.2} strain {:.1} {:.1}",
        e.model,
        e.polarity,
        v.bend.to_degrees(),
        v.separable,
        v.unlike,
        v.balance,
        v.cell_snr,
        v.dissent,
        v.hidden,
        v.v[0],
        v.v[1],
        v.v2[0],
        v.v2[1],
        v.good,
        v.good_near,
        v.tiles,
        v.tiles2,
        e.margin,
        e.gain,
        e.range_sigma / e.range,
        e.tilt_sigma.to_degrees(),
        v.comb[0],
        v.comb[1],
        v.comb_good,
        v.comb_near,
        v.above,
        v.scatter[0],
        v.scatter[1],
        v.bumps.to_degrees(),
        v.strain[0],
        v.strain[1],
    )
}
