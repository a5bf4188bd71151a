//! Random scenes for studies of accuracy: every seed a scene, drawn over the whole range that an estimator is asked to cover.

mod draw;

use crate::error::{Error, Result};
use crate::scenario::Scenario;
use crate::scene::{Backdrop, Growth, Kind, Layer, Net, Scene, Texture, Twine};
use draw::Draw;

/// Focal length of the studies' camera (the thesis's), px.
const FOCAL_PX: f64 = 600.0;

/// Where random scenes come from. The scene of a seed never depends on another seed's.
///
/// In all of them the net can be seen, in principle: along the direction in which tilt shortens them, meshes at the optical axis are
/// at least 3 px, and point spread and defocus together at most a quarter of that. How much of it is hidden is in the truth
/// ([`LayerTruth::visible_share`](crate::LayerTruth::visible_share)).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Study {
    /// Flat nets: range 0.3 to 8 m (evenly in its logarithm), tilt 0 to 70 degrees about any axis, any turn, light and dark twine, contrast
    /// over noise 0.5 to 10, defocus to 4 px, up to 60 % of the view behind fish, node jitter to 5 %. Half of the meshes are 50 mm
    /// square, the others squares of 20 to 80 mm, rectangles and diamonds; every fourth camera has a lens that distorts, every fifth net
    /// ends inside the view.
    Planar,
    /// Nets as they hang: as [`Study::Planar`] from 0.3 to 3 m and to 55 degrees, the crossing angle off by up to 18 degrees, the
    /// sheet a smooth random field of 22 mm over 0.36 m plus a bend of up to 0.6 per metre, threads bent in the plane; every side
    /// keeps its length. One in three of 27.5 mm mesh, out to 1.6 m.
    Hung,
    /// No net of the mesh asked for: open water, fish, ropes and rods, ladders, kelp, and every [`Texture`], in all kinds of water and
    /// noise.
    Negative,
    /// What a covariance is held against: flat square nets of 50 mm from 0.4 to 4 m and to 55 degrees, contrast over noise 1 to 10,
    /// nothing amiss but the noise.
    Noise,
    /// As [`Study::Noise`], knots 2 % of a side off their places.
    Jitter2,
    /// As [`Study::Noise`], knots 5 % of a side off their places.
    Jitter5,
    /// As [`Study::Noise`], the sheet bent by up to 0.15 per metre in every direction, sides as long as ever.
    Sag,
    /// As [`Study::Noise`], knots up to 3 % of a side off their places, and tufts of growth on a tenth to nine tenths of the twine pieces, 8 to 24 mm, dark as a rule.
    Overgrown,
    /// Two nets one behind the other: as [`Study::Noise`], the front one from 0.4 to 1.5 m and to 40 degrees, the other 1.3 to 2.5 times as
    /// far and turned by up to 25 degrees against it; nowhere in view do they meet.
    Layers,
    /// Two sheets sewn together: as [`Study::Noise`] from 0.5 to 2.5 m and to 40 degrees, and beside a seam that runs through the picture, 5
    /// to 30 % of the range aside of the optical axis, a second sheet turned about it by 10 to 50 degrees, its rows beginning anywhere. The
    /// first layer is the sheet that the axis meets.
    Seam,
}

impl Study {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Planar,
        Self::Hung,
        Self::Negative,
        Self::Noise,
        Self::Jitter2,
        Self::Jitter5,
        Self::Sag,
        Self::Overgrown,
        Self::Layers,
        Self::Seam,
    ];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Planar => "planar",
            Self::Hung => "hung",
            Self::Negative => "negative",
            Self::Noise => "noise",
            Self::Jitter2 => "jitter2",
            Self::Jitter5 => "jitter5",
            Self::Sag => "sag",
            Self::Overgrown => "overgrown",
            Self::Layers => "layers",
            Self::Seam => "seam",
        }
    }

    /// The scene of this seed.
    pub fn scenario(self, seed: u64) -> Scenario {
        let drawn = match self {
            Self::Planar => planar(seed),
            Self::Hung => hung(seed),
            Self::Negative => negative(seed),
            Self::Noise => steady(seed, |_, _| {}),
            Self::Jitter2 => steady(seed, |_, net| net.jitter = 0.02),
            Self::Jitter5 => steady(seed, |_, net| net.jitter = 0.05),
            Self::Sag => steady(seed, |draw, net| {
                let bend = 0.15;
                net.surface.curvature_per_m =
                    [draw.between(-bend, bend), draw.between(-bend, bend), draw.between(-bend, bend)];
            }),
            Self::Overgrown => steady(seed, |draw, net| {
                net.jitter = draw.between(0.0, 0.03);
                net.growth = Growth {
                    density: draw.between(0.1, 0.9),
                    size_m: draw.between(0.008, 0.024),
                    grey: draw.between(5.0, 100.0),
                    ..Growth::default()
                };
            }),
            Self::Layers => layers(seed),
            Self::Seam => seam(seed),
        };
        Scenario { name: format!("study-{}-{seed}", self.name()), seed, ..drawn }
    }

    /// [`Study::Planar`]'s scene of this seed.
    pub fn planar(seed: u64) -> Scenario {
        Self::Planar.scenario(seed)
    }

    /// [`Study::Hung`]'s scene of this seed.
    pub fn hung(seed: u64) -> Scenario {
        Self::Hung.scenario(seed)
    }

    /// [`Study::Negative`]'s scene of this seed.
    pub fn negative(seed: u64) -> Scenario {
        Self::Negative.scenario(seed)
    }
}

impl std::str::FromStr for Study {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|s| s.name() == name);
        found.ok_or_else(|| Error::Name { what: "study", name: name.to_owned() })
    }
}

fn planar(seed: u64) -> Scenario {
    let mut draw = Draw::new(seed, 1);
    let mut net = Net { seed, ..Net::default() };
    (net.side1_m, net.side2_m, net.angle_deg) = draw.mesh();
    let shortest_m = f64::min(net.side1_m, net.side2_m);
    let pose = draw.pose(0.3, 8.0, 70.0, shortest_m);
    net.twine.diameter_m = shortest_m * draw.between(0.03, 0.06);
    if draw.chance(0.5) {
        net.jitter = draw.between(0.0, 0.05);
    }
    if draw.chance(0.4) {
        net.twine.knot = draw.between(1.2, 2.4);
    }
    if draw.chance(0.2) {
        net.extent = draw.extent(&net, &pose);
    }
    let mesh = net.mesh().map_or_else(|_| String::new(), |mesh| mesh.to_string());
    let mut scene = Scene { layers: vec![Layer { net, pose }], seed, ..Scene::empty() };
    draw.contrast(&mut scene, 0.5);
    draw.blur(&mut scene, shortest_m);
    draw.surroundings(&mut scene);
    draw.fish(&mut scene, 0.6);
    Scenario { camera: draw.camera(), ..scenario("A flat net, drawn at random", &mesh, scene) }
}

fn hung(seed: u64) -> Scenario {
    let mut draw = Draw::new(seed, 2);
    let fine = draw.chance(1.0 / 3.0);
    let (mesh, side_m, far_m) = if fine { ("27.5mm", 0.0275, 1.6) } else { ("50mm", 0.05, 3.0) };
    let pose = draw.pose(0.3, far_m, 55.0, side_m);
    let mut net = Net { side1_m: side_m, side2_m: side_m, seed, ..Net::default() };
    net.shear_deg = draw.between(-18.0, 18.0);
    net.surface = draw.surface();
    net.jitter = draw.between(0.0, 0.02);
    net.slack = draw.between(0.0, 0.01);
    net.twine = Twine {
        diameter_m: side_m * draw.between(0.03, 0.06),
        knot: draw.between(1.0, 2.4),
        variation: draw.between(0.0, 0.1),
        ..Twine::default()
    };
    if draw.chance(0.3) {
        net.growth = Growth { density: draw.between(0.0, 0.12), size_m: 0.3 * side_m, ..Growth::default() };
    }
    let mut scene = Scene { layers: vec![Layer { net, pose }], seed, ..Scene::empty() };
    draw.contrast(&mut scene, 1.0);
    draw.blur(&mut scene, side_m);
    draw.surroundings(&mut scene);
    draw.fish(&mut scene, 0.3);
    scenario("A sheared and bent net, drawn at random", mesh, scene)
}

fn negative(seed: u64) -> Scenario {
    let mut draw = Draw::new(seed, 3);
    let mut scene = Scene { seed, ..Scene::empty() };
    draw.contrast(&mut scene, 1.0);
    draw.surroundings(&mut scene);
    scene.sensor.defocus_px = if draw.chance(0.3) { draw.between(0.0, 2.0) } else { 0.0 };
    let what = match draw.index(5 + Texture::ALL.len() as u64) as usize {
        0 => {
            scene.water.rays_grey = draw.between(0.0, 20.0);
            scene.water.mottle_grey = draw.between(2.0, 20.0);
            scene.snow.density_per_m3 = draw.between(0.0, 1000.0);
            "open water".to_owned()
        }
        1 => {
            draw.fish(&mut scene, 0.6);
            "fish".to_owned()
        }
        2 => {
            draw.bars(&mut scene, &[Kind::Rope, Kind::Rod], 1.0, [0.006, 0.05]);
            "ropes and rods".to_owned()
        }
        3 => {
            draw.bars(&mut scene, &[Kind::Ladder], 0.3, [0.15, 0.45]);
            "ladders".to_owned()
        }
        4 => {
            draw.bars(&mut scene, &[Kind::Kelp], 1.5, [0.02, 0.08]);
            "kelp".to_owned()
        }
        texture => {
            let texture = Texture::ALL[texture - 5];
            scene.backdrop = Some(Backdrop {
                texture,
                pose: draw.pose(0.4, 4.0, 60.0, 0.05),
                scale_m: 0.05 * draw.logarithmic(0.4, 2.5),
                grey: scene.water.veil_grey,
                contrast_grey: draw.sign() * draw.between(8.0, 60.0),
                seed,
            });
            format!("{texture:?}").to_lowercase()
        }
    };
    scenario(&what, "50mm", scene)
}

/// Flat square nets and noise, and what `change` adds.
fn steady(seed: u64, change: fn(&mut Draw, &mut Net)) -> Scenario {
    let mut draw = Draw::new(seed, 4);
    let mut net = Net { seed, ..Net::default() };
    let pose = draw.pose(0.4, 4.0, 55.0, net.side1_m);
    net.twine.diameter_m = draw.between(0.0015, 0.003);
    let mut scene = Scene { layers: vec![Layer { net, pose }], seed, ..Scene::empty() };
    draw.contrast(&mut scene, 1.0);
    scene.layers.iter_mut().for_each(|layer| change(&mut draw, &mut layer.net));
    scenario("A flat net for covariances, drawn at random", "50mm", scene)
}

fn layers(seed: u64) -> Scenario {
    let mut draw = Draw::new(seed, 5);
    let (front, back) = draw.behind(0.05);
    let net = |draw: &mut Draw, number| Net {
        seed: seed.wrapping_add(number),
        twine: Twine { diameter_m: draw.between(0.0015, 0.003), ..Twine::default() },
        ..Net::default()
    };
    let layers = vec![Layer { net: net(&mut draw, 0), pose: front }, Layer { net: net(&mut draw, 1), pose: back }];
    let mut scene = Scene { layers, seed, ..Scene::empty() };
    draw.contrast(&mut scene, 1.0);
    scenario("A net behind a net, drawn at random", "50mm", scene)
}

fn seam(seed: u64) -> Scenario {
    let mut draw = Draw::new(seed, 6);
    let twine = Twine { diameter_m: draw.between(0.0015, 0.003), ..Twine::default() };
    let layers = draw.sewn(&Net { seed, twine, ..Net::default() });
    let mut scene = Scene { layers, seed, ..Scene::empty() };
    draw.contrast(&mut scene, 1.0);
    scenario("Two sheets that meet at a seam, drawn at random", "50mm", scene)
}

fn scenario(description: &str, mesh: &str, scene: Scene) -> Scenario {
    Scenario { description: description.to_owned(), mesh: mesh.to_owned(), scene, ..Scenario::default() }
}
