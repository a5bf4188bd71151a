//! What is no net.

use super::{Scenario, named, ordinary, salmon, tilted};
use crate::scene::{Backdrop, Kind, NetPose, Object, Scene, Texture, Water};

/// Pictures without a net of the mesh that is asked for.
pub(super) fn negatives() -> Vec<Scenario> {
    let water = || {
        let mut scene = ordinary(NetPose::default());
        scene.layers.clear();
        scene
    };
    let mut list = Vec::new();
    let mut add = |name: &str, description: &str, change: &dyn Fn(&mut Scene)| {
        let mut scene = water();
        change(&mut scene);
        list.push(named(name, description, scene));
    };
    add("no-water", "No net: open water with shafts of light and snow", &|s| {
        s.water = Water { rays_grey: 14.0, mottle_grey: 9.0, ..s.water };
        s.snow.density_per_m3 = 300.0;
    });
    add("no-fish", "No net: salmon", &|s| {
        s.objects =
            vec![salmon(0.9, -0.2, 0.0, 8.0, 1), salmon(1.3, 0.5, -0.3, 175.0, 2), salmon(1.6, -0.6, 0.4, 0.0, 3)];
    });
    add("no-ropes", "No net: mooring ropes and cables", &|s| {
        let rope = |x_m: f64, y_m: f64, turn_deg: f64, width_m: f64, grey: f64, kind: Kind| Object {
            kind,
            range_m: 1.1,
            x_m,
            y_m,
            turn_deg,
            length_m: 5.0,
            width_m,
            grey,
            contrast: 0.7,
            ..Object::default()
        };
        s.objects = vec![
            rope(-0.3, 0.0, 82.0, 0.04, 150.0, Kind::Rope),
            rope(0.25, 0.0, 97.0, 0.028, 170.0, Kind::Rope),
            rope(0.0, 0.2, 12.0, 0.02, 40.0, Kind::Rod),
            rope(0.45, 0.0, 70.0, 0.012, 50.0, Kind::Rod),
        ];
    });
    add("no-ladder", "No net: a ladder", &|s| {
        let ladder = |x_m: f64, turn_deg: f64| Object {
            kind: Kind::Ladder,
            range_m: 1.2,
            x_m,
            turn_deg,
            length_m: 4.0,
            width_m: 0.3,
            grey: 175.0,
            ..Object::default()
        };
        s.objects = vec![ladder(0.05, 86.0)];
    });
    add("no-kelp", "No net: kelp", &|s| {
        s.objects = (0..12u8)
            .map(|k| Object {
                kind: Kind::Kelp,
                range_m: 0.9 + 0.12 * f64::from(k % 5),
                x_m: -0.75 + 0.135 * f64::from(k),
                turn_deg: 88.0 + 5.0 * (f64::from(k) * 1.7).sin(),
                length_m: 2.4,
                width_m: 0.035 + 0.008 * f64::from(k % 4),
                grey: 45.0 + 6.0 * f64::from(k % 3),
                seed: u64::from(k),
                ..Object::default()
            })
            .collect();
    });
    let textures = [
        (Texture::Seabed, "no-seabed", "No net: the seabed", 0.08),
        (Texture::Noise, "no-noise", "No net: grainy noise", 0.03),
        (Texture::Band, "no-band", "No net: noise of one wavelength, a ring in the spectrum", 0.05),
        (Texture::Stripes, "no-stripes", "No net: bars of one direction", 0.05),
        (Texture::Bricks, "no-bricks", "No net: bricks in running bond", 0.065),
        (Texture::Scales, "no-scales", "No net: overlapping scales", 0.06),
        (Texture::Cells, "no-cells", "No net: cells of random shape", 0.05),
        (Texture::Hexagons, "no-hexagons", "No net of this mesh: six-sided meshes", 0.05),
        (Texture::Sticks, "no-sticks", "No net: straight lines of all directions", 0.05),
        (Texture::LatticeNoise, "no-lattice-noise", "No net: noise with a net's spectrum, phases wandering", 0.05),
        (Texture::RandomGrid, "no-random-grid", "No net: two families of twine at random spacings", 0.05),
    ];
    for (texture, name, description, scale_m) in textures {
        add(name, description, &|s| {
            let pose = tilted(1.2, if texture == Texture::Seabed { -35.0 } else { 12.0 }, 14.0, 5.0);
            s.backdrop = Some(Backdrop { texture, pose, scale_m, grey: 110.0, contrast_grey: 32.0, seed: 1 });
        });
    }
    list
}
