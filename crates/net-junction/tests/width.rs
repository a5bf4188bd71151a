//! Apparent widths of twines against those that the simulator drew.

use net_geometry::{Camera, Lens, Mesh};
use net_junction::{AdjustConfig, ExpectedNet, NetAdjuster, Twine, TwineState};
use net_sim::{Growth, Image, Layer, Net, NetPose, Scene, Sensor, Simulator, Water};

/// Focal length, px, over distance, m.
const PX_PER_M: f64 = 600.0 / 0.6;

/// The twines of a picture of such a net 0.6 m away, expected where it is.
fn look(net: &Net, psf_px: f64) -> Vec<Twine> {
    let camera = Camera::new(600.0, 600.0, 423.5, 239.5, 848, 480, Lens::None).expect("a camera");
    let pose = NetPose { range_m: 600.0 / PX_PER_M, roll_deg: 4.0, tilt_y_deg: 5.0, ..NetPose::default() };
    let net = Net { jitter: 0.02, seed: 3, ..net.clone() };
    let water = Water { attenuation_per_m: 0.3, gradient_grey: 60.0, ..Water::default() };
    let sensor = Sensor { psf_px, ..Sensor::default() };
    let scene = Scene { layers: vec![Layer { net, pose }], water, sensor, ..Scene::default() };
    let mut image = Image::default();
    Simulator::new(camera).render(&scene, 3, &mut image).expect("a scene");
    let mut adjuster = NetAdjuster::new(848, 480, &AdjustConfig::default()).expect("default");
    let mesh = Mesh::square(0.05).expect("a mesh");
    let expected = ExpectedNet { camera, mesh, pose: pose.pose(), anchored: true };
    adjuster.adjust(image.view().expect("pixels"), &expected).expect("the size is right");
    adjuster.twines().to_vec()
}

fn net(diameter_m: f64, grey: f64) -> Net {
    Net { twine: net_sim::Twine { diameter_m, grey, ..net_sim::Twine::default() }, ..Net::default() }
}

/// Tenth, median and ninetieth hundredth of what is told of twines of a state, and their number.
fn widths(twines: &[Twine], state: TwineState) -> ([f32; 3], usize) {
    let mut told: Vec<f32> = twines.iter().filter(|t| t.state == state).filter_map(|t| t.width_px).collect();
    told.sort_by(f32::total_cmp);
    ([1, 5, 9].map(|q| told.get(q * told.len() / 10).copied().unwrap_or(f32::NAN)), told.len())
}

#[test]
fn clean_twine_is_as_wide_as_it_is_or_as_blur_makes_it() {
    for psf_px in [0.5, 1.2] {
        for diameter_m in [0.0015, 0.002, 0.003, 0.004, 0.006] {
            let twines = look(&net(diameter_m, 200.0), psf_px);
            let ([low, middle, high], told) = widths(&twines, TwineState::Present);
            let truth = diameter_m * PX_PER_M;
            println!("{truth} px, blur {psf_px}: {low:.2} {middle:.2} {high:.2} of {told}");
            // All but the rim: a sixth of these lie half outside, or have no mesh beside them.
            assert!(10 * told > 7 * twines.len(), "{told} of {}", twines.len());
            // A line of no width has the width of the point spread over its height, 2.5 deviations.
            let blurred = truth.hypot((2.0 * std::f64::consts::PI).sqrt() * psf_px) as f32;
            assert!(middle > 0.9 * truth as f32 && (middle / blurred - 1.0).abs() < 0.15, "{middle} for {blurred}");
            assert!(low > 0.85 * middle && high < 1.2 * middle, "{low} {middle} {high}");
            let most = twines.iter().filter_map(|t| t.width_px).fold(0.0, f32::max);
            assert!(most < 2.0 * middle, "{most} for {middle}: at the rim, too");
        }
    }
}

#[test]
fn overgrown_twine_is_wider() {
    for grey in [45.0, 150.0, 220.0] {
        let growth = Growth { density: 0.3, size_m: 0.016, patchiness: 0.0, grey, ..Growth::default() };
        let twines = look(&Net { growth, ..net(0.002, 200.0) }, 0.7);
        let (present, _) = widths(&twines, TwineState::Present);
        let (fouled, told) = widths(&twines, TwineState::Fouled);
        println!("growth of grey {grey}: present {present:?}, fouled {fouled:?} of {told}");
        assert!(told >= 5 && fouled[1] > 1.2 * present[1], "{fouled:?} {present:?}");
    }
}

#[test]
fn nothing_is_said_of_twine_that_is_gone_or_cannot_be_seen() {
    let torn = look(&Net { broken: 0.1, ..net(0.002, 200.0) }, 0.7);
    for state in [TwineState::Missing, TwineState::Doubtful, TwineState::Hidden] {
        assert_eq!(widths(&torn, state).1, 0, "{state:?}");
    }
    assert!(torn.iter().any(|t| t.state == TwineState::Missing));
    assert!(widths(&torn, TwineState::Present).1 > 200);
    // As bright as the water.
    let faint = look(&net(0.002, 92.0), 0.7);
    let told = faint.iter().filter(|t| t.width_px.is_some()).count();
    assert!(10 * told < faint.len().max(1), "{told} of {}", faint.len());
}
