use proptest::prelude::*;

use super::*;

const ROS: &str = "\
image_width: 848
image_height: 480
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [420.5, 0.0, 423.25, 0.0, 421, 239.75, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.25, 0.0625, 1e-3, -2.0e-4, 0.5]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
";

const KALIBR: &str = "\
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.1, 0.02, 0.003, -0.004]
  distortion_model: radtan
  intrinsics: [460.5, 461.5, 370.25, 230.75]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, 0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [0.5, -0.25, 0.125, -0.0625]
  distortion_model: equi
  intrinsics: [190.5, 191.5, 254.25, 256.75]
  resolution: [512, 512]
  rostopic: /cam1/image_raw
";

fn parse(text: &str) -> Result<Camera> {
    parse_camera("front.yaml", text.as_bytes(), None)
}

/// The error's text, which must name the file.
fn refusal(text: &str) -> String {
    let text = parse(text).expect_err("must be refused").to_string();
    assert!(text.starts_with("front.yaml: "), "{text}");
    text
}

#[test]
fn ros_camera_info() {
    let camera = parse(ROS).expect("a camera");
    let lens = Lens::PlumbBob([-0.25, 0.0625, 1e-3, -2.0e-4, 0.5]);
    assert_eq!(camera, Camera::new(420.5, 421.0, 423.25, 239.75, 848, 480, lens).expect("valid"));
}

#[test]
fn ros_lens_models() {
    let with = |model: &str, data: &str| {
        parse(&ROS.replace("plumb_bob", model).replace("[-0.25, 0.0625, 1e-3, -2.0e-4, 0.5]", data)).map(|c| *c.lens())
    };
    let lens = |model, data| with(model, data).expect("valid");
    assert_eq!(lens("plumb_bob", "[1, 2, 0.3, 0.4]"), Lens::PlumbBob([1.0, 2.0, 0.3, 0.4, 0.0]));
    assert_eq!(lens("plumb_bob", "[1, 2, 0.3, 0.4, 5, 0, 0, 0]"), Lens::PlumbBob([1.0, 2.0, 0.3, 0.4, 5.0]));
    assert_eq!(lens("plumb_bob", "[]"), Lens::None);
    assert_eq!(lens("equidistant", "[1, 2, 3, 4]"), Lens::KannalaBrandt([1.0, 2.0, 3.0, 4.0]));
    assert_eq!(lens("fisheye", "[1, 2, 3, 4]"), Lens::KannalaBrandt([1.0, 2.0, 3.0, 4.0]));
    let eight = Lens::Rational([1.0, 2.0, 0.03, 0.04, 5.0, 0.6, 0.7, 0.8]);
    assert_eq!(lens("rational_polynomial", "[1, 2, 0.03, 0.04, 5, 0.6, 0.7, 0.8]"), eight);
    assert_eq!(lens("rational_polynomial", "[1, 2, 0.03, 0.04, 5, 0.6, 0.7, 0.8, 0, 0, 0, 0, 0, 0]"), eight);
    assert_eq!(lens("none", "[0, 0, 0, 0]"), Lens::None);
    for (model, data) in [
        ("plumb_bob", "[1, 2, 3]"),
        ("plumb_bob", "[1, 2, 3, 4, 5, 6, 7, 8]"),
        ("equidistant", "[1, 2, 3, 4, 5]"),
        ("equidistant", "[1, 2]"),
        ("rational_polynomial", "[1, 2, 3, 4, 5]"),
        ("rational_polynomial", "[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]"),
        ("none", "[1]"),
        ("plumb_bob", "[1, 2, 3, .nan]"),
        ("plumb_bob", "[1, 2, 3, .inf]"),
    ] {
        let text = with(model, data).expect_err("must be refused").to_string();
        assert!(text.contains("distortion_coefficients is "), "{model} {data}: {text}");
    }
    let text = with("omnidirectional", "[1, 2, 3, 4]").expect_err("must be refused").to_string();
    assert!(text.contains("distortion_model is \"omnidirectional\": expected one of none, plumb_bob"), "{text}");
}

#[test]
fn bad_intrinsics_name_field_and_value() {
    assert!(refusal(&ROS.replace("420.5", "0.0")).contains("fx is 0: "));
    assert!(refusal(&ROS.replace("421,", "-421.0,")).contains("fy is -421: "));
    assert!(refusal(&ROS.replace("423.25", ".nan")).contains("cx is NaN: "));
    assert!(refusal(&ROS.replace("848", "0")).contains("image_width is 0: "));
    assert!(refusal(&ROS.replace("480", "4000000000")).contains("image_height is 4000000000: "));
    assert!(refusal(&ROS.replace("420.5, 0.0,", "420.5, 2.5,")).contains("camera_matrix, row 0, column 1 is 2.5: "));
    assert!(refusal(&ROS.replace("0.0, 0.0, 1.0]", "0.0, 1.0]")).contains("camera_matrix is of 8 numbers: "));
    assert!(refusal(&ROS.replace("image_width", "width")).contains("image_width is missing: "));
    assert!(refusal(&ROS.replace("distortion_model", "model")).contains("distortion_model is missing: "));
    assert!(refusal("").contains("camera_matrix is missing") || refusal("").contains("YAML is unreadable"));
}

#[test]
fn what_is_no_calibration_names_line_and_field() {
    let only = KALIBR.split("cam1:").next().expect("text");
    for (text, expected) in [
        (ROS.replace("848", "wide"), "line 1, field image_width (image_width: wide): expected a whole number"),
        (
            ROS.replace("848", "-8"),
            "line 1, field image_width (image_width: -8): expected a whole number, not below zero",
        ),
        (ROS.replace("420.5", "abc"), "line 7, field camera_matrix.data (data: [abc, 0.0, "),
        (ROS.replace("420.5", "abc"), "1.0]): expected a number"),
        (ROS.replace("[420.5,", "420.5,"), "line 7, field camera_matrix.data (data: 420.5, 0.0, 423.25"),
        (ROS.replace("[420.5,", "420.5,"), "expected a list of numbers"),
        (
            ROS.replace("camera_matrix:", "camera_matrix: 5\nx:"),
            "line 4, field camera_matrix (camera_matrix: 5): expected",
        ),
        (format!("{ROS}image_width: 5\n"), "field image_width (image_width: 5): expected this field once"),
        (ROS.replace("  rows: 3\n  cols: 3\n  data: [4", "\tdata: [4"), "line 5 (data: [420.5, "),
        ("hello".to_owned(), "line 1 (hello): expected fields of a camera_info file"),
        ("[1, 2".to_owned(), "line 1 ([1, 2): expected"),
        (
            only.replace("460.5", "x"),
            "field cam0.intrinsics (intrinsics: [x, 461.5, 370.25, 230.75]): expected a number",
        ),
    ] {
        let said = refusal(&text);
        assert!(said.starts_with("front.yaml: YAML is unreadable in line ") && said.contains(expected), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

/// Numbers of another unit, or of another camera.
#[test]
fn a_lens_that_takes_nothing_into_the_picture_names_field_and_value() {
    let text = refusal(&ROS.replace("[-0.25, 0.0625, 1e-3, -2.0e-4, 0.5]", "[1e6, 0, 0, 0, 0]"));
    assert!(text.contains("distortion_coefficients is [1000000.0, 0.0, 0.0, 0.0, 0.0]: expected a lens"), "{text}");
    assert!(text.contains("0 % of them"), "{text}");
    let only = KALIBR.split("cam1:").next().expect("text");
    let text = refusal(&only.replace("[-0.1, 0.02, 0.003, -0.004]", "[-7, 0, 0, 0]"));
    assert!(text.contains("cam0.distortion_coeffs is [-7.0, 0.0, 0.0, 0.0]: expected a lens"), "{text}");
}

#[test]
fn a_calibration_never_done() {
    // What drivers publish before calibration.
    let zeros = ROS.replace("[420.5, 0.0, 423.25, 0.0, 421, 239.75, 0.0, 0.0, 1.0]", "[0, 0, 0, 0, 0, 0, 0, 0, 0]");
    assert!(refusal(&zeros).contains("camera_matrix, row 2, column 2 is 0: "));
}

#[test]
fn kalibr_camchain() {
    let of = |topic| parse_camera("chain.yaml", KALIBR.as_bytes(), topic);
    let lens = Lens::PlumbBob([-0.1, 0.02, 0.003, -0.004, 0.0]);
    let cam0 = Camera::new(460.5, 461.5, 370.25, 230.75, 752, 480, lens).expect("valid");
    let lens = Lens::KannalaBrandt([0.5, -0.25, 0.125, -0.0625]);
    let cam1 = Camera::new(190.5, 191.5, 254.25, 256.75, 512, 512, lens).expect("valid");
    assert_eq!(of(Some("/cam0/image_raw")).expect("cam0"), cam0);
    assert_eq!(of(Some("/cam1/image_raw")).expect("cam1"), cam1);
    // Two cameras, and nothing to tell which: no guess.
    for topic in [None, Some("/cam7/image_raw")] {
        let text = of(topic).expect_err("ambiguous").to_string();
        assert!(text.contains("cameras is 2: ") && text.contains("/cam1/image_raw"), "{text}");
    }
    let only = KALIBR.split("cam1:").next().expect("text");
    assert_eq!(parse(only).expect("cam0"), cam0);
    assert!(refusal(&only.replace("pinhole", "omni")).contains("cam0.camera_model is \"omni\": "));
    assert!(refusal(&only.replace("radtan", "fov")).contains("cam0.distortion_model is \"fov\": "));
    assert!(refusal(&only.replace("[460.5, ", "[")).contains("cam0.intrinsics is [461.5, 370.25, 230.75]: "));
    assert!(refusal(&only.replace("[752, 480]", "[752]")).contains("cam0.resolution is [752]: "));
}

#[test]
fn file_that_is_not_there() {
    let text = read_camera(Path::new("/nowhere/camera.yaml")).expect_err("missing").to_string();
    assert!(text.starts_with("cannot read /nowhere/camera.yaml: "), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Whatever is cut, changed or inserted: an error or a camera of finite numbers, never a panic.
    #[test]
    fn any_bytes(kalibr: bool, at in 0.0..1.0f64, byte: u8, cut: bool) {
        let mut bytes = if kalibr { KALIBR } else { ROS }.as_bytes().to_vec();
        let at = (at * bytes.len() as f64) as usize;
        bytes[at] = byte;
        if cut {
            bytes.truncate(at);
        }
        if let Ok(camera) = parse_camera("x", &bytes, Some("/cam0/image_raw")) {
            prop_assert!(camera.fx() > 0.0 && camera.fy() > 0.0 && camera.cx().is_finite() && camera.cy().is_finite());
        }
    }
}
