//! The net as single sections see it: wave vectors with common labels and signs, basis, cell poses.

use net_geometry::nalgebra::Vector2;
use net_geometry::{Basis, Mesh};

use crate::cell::cell_poses;
use crate::choose::{Confidence, angle_between, choose};
use crate::estimate::SectionPose;
use crate::evidence::Section;
use crate::field::LatticeField;
use crate::measure::wave_near;

/// A candidate at most so far from a wave vector is that one, bins.
const SAME_BINS: f64 = 2.0;

/// Poses of all sections that show the waves of `field`. The field's first side is the first side of `mesh`.
pub(crate) fn agreed_poses(field: &LatticeField, sections: &[Section], mesh: &Mesh, out: &mut Vec<SectionPose>) {
    out.clear();
    for (index, section) in sections.iter().enumerate() {
        let Some(expected) = section.bins_of(field) else { continue };
        let radius = SAME_BINS.min(0.45 * expected[0].norm()).min(0.45 * expected[1].norm());
        let found = expected.map(|bin| wave_near(section, bin, radius.max(1.0)));
        let [Some((first, _)), Some((second, _))] = found else { continue };
        let confidence = [first, second].map(|bin| confidence_of(section, bin));
        let Some(mut pose) = section_pose(index, section, [first, second], mesh, confidence) else { continue };
        pose.choose_nearest_to(field.normal);
        out.push(pose);
    }
}

/// Poses of all sections by their own choice. Labels and signs follow those of the surest section, so that a net near 45 degrees keeps its sides apart.
pub(crate) fn own_poses(sections: &[Section], mesh: &Mesh, min_angle: f64, out: &mut Vec<SectionPose>) {
    out.clear();
    let choices = || {
        sections.iter().enumerate().filter_map(|(index, section)| {
            let candidates = section.spectrum.candidates();
            let choice = choose(candidates, &section.view, min_angle)?;
            Some((index, choice.candidates.map(|i| candidates[i].bin), choice.confidence))
        })
    };
    let surest = choices().max_by(|a, b| (a.2[0].ratio + a.2[1].ratio).total_cmp(&(b.2[0].ratio + b.2[1].ratio)));
    let Some((reference, bins, _)) = surest else { return };
    let mut sides = bins.map(|bin| sections[reference].view.ideal_from_bin(bin));
    // The side whose twines stand more upright comes first: its wave vector lies nearer to the u axis.
    if sides[0].x.abs() * sides[1].norm() < sides[1].x.abs() * sides[0].norm() {
        sides.swap(0, 1);
    }
    if sides[0].x < 0.0 {
        sides[0] = -sides[0];
    }
    if sides[0].perp(&sides[1]) < 0.0 {
        sides[1] = -sides[1];
    }
    for (index, mut bins, mut confidence) in choices() {
        let view = &sections[index].view;
        let ideal = |bin: Vector2<f64>| view.ideal_from_bin(bin);
        let off =
            |a: usize, b: usize| angle_between(ideal(bins[0]), sides[a]) + angle_between(ideal(bins[1]), sides[b]);
        if off(1, 0) < off(0, 1) {
            bins.swap(0, 1);
            confidence.swap(0, 1);
        }
        for (bin, side) in bins.iter_mut().zip(&sides) {
            if view.ideal_from_bin(*bin).dot(side) < 0.0 {
                *bin = -*bin;
            }
        }
        out.extend(section_pose(index, &sections[index], bins, mesh, confidence));
    }
}

fn section_pose(
    index: usize,
    section: &Section,
    bins: [Vector2<f64>; 2],
    mesh: &Mesh,
    confidence: [Confidence; 2],
) -> Option<SectionPose> {
    let ideal = bins.map(|bin| section.view.ideal_from_bin(bin));
    // The back of a cell is no pose of it.
    if ideal[0].perp(&ideal[1]) <= 0.0 {
        return None;
    }
    let waves = bins.map(|bin| section.view.wave_from_bin(bin));
    let basis = Basis::from_wave_vectors(waves[0], waves[1]).ok()?;
    let poses = cell_poses(ideal, section.view.ray, mesh).ok()?;
    Some(SectionPose { section: index, bins, basis, poses, chosen: 0, confidence })
}

/// Value of the candidate at `bin` over that of the best candidate that is not it.
fn confidence_of(section: &Section, bin: Vector2<f64>) -> Confidence {
    let candidates = section.spectrum.candidates();
    let same = |other: Vector2<f64>| (other - bin).norm().min((other + bin).norm()) <= SAME_BINS;
    let own = candidates.iter().find(|candidate| same(candidate.bin)).map_or(0.0, |candidate| candidate.value());
    let rival = candidates.iter().enumerate().find(|(_, candidate)| !same(candidate.bin));
    Confidence::against(own, rival.map(|(index, candidate)| (index, candidate.value())))
}
