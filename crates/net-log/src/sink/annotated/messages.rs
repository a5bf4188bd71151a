//! The messages of `annotated.mcap`, and their descriptors, which the file carries along.
//!
//! Names and field numbers of the package `foxglove` are those of Foxglove's published schemas: viewers know them by name.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto};
use prost_types::{FileDescriptorProto, FileDescriptorSet, Timestamp};

/// Package of a message type.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Package {
    Foxglove,
    Netpose,
}

/// Kind of a field.
enum Kind {
    Double,
    Fixed32,
    Uint64,
    Text,
    /// A message of the package `foxglove`.
    Of(&'static str),
    Time,
    /// `PointsAnnotation.Type`.
    PointsType,
    Many(&'static Kind),
}
use Kind::{Double, Fixed32, Many, Of, PointsType, Text, Time, Uint64};

macro_rules! messages {
    ($($package:ident $name:ident { $($field:ident: $type:ty, $number:literal, $kind:expr, $(#[$meta:meta])*;)* })*) => {
        $(
            #[derive(Clone, PartialEq, Message)]
            #[allow(non_snake_case)]
            pub(super) struct $name {
                $($(#[$meta])* pub $field: $type,)*
            }
        )*
        /// Every message type with its fields, as the structs above have them.
        const MESSAGES: &[(Package, &str, &[(&str, i32, Kind)])] = &[
            $((Package::$package, stringify!($name), &[$((stringify!($field), $number, $kind)),*]),)*
        ];
    };
}

messages! {
    Foxglove Vector3 {
        x: f64, 1, Double, #[prost(double, tag = "1")];
        y: f64, 2, Double, #[prost(double, tag = "2")];
        z: f64, 3, Double, #[prost(double, tag = "3")];
    }
    Foxglove Quaternion {
        x: f64, 1, Double, #[prost(double, tag = "1")];
        y: f64, 2, Double, #[prost(double, tag = "2")];
        z: f64, 3, Double, #[prost(double, tag = "3")];
        w: f64, 4, Double, #[prost(double, tag = "4")];
    }
    Foxglove Pose {
        position: Option<Vector3>, 1, Of("Vector3"), #[prost(message, optional, tag = "1")];
        orientation: Option<Quaternion>, 2, Of("Quaternion"), #[prost(message, optional, tag = "2")];
    }
    Foxglove PoseInFrame {
        timestamp: Option<Timestamp>, 1, Time, #[prost(message, optional, tag = "1")];
        frame_id: String, 2, Text, #[prost(string, tag = "2")];
        pose: Option<Pose>, 3, Of("Pose"), #[prost(message, optional, tag = "3")];
    }
    Foxglove FrameTransform {
        timestamp: Option<Timestamp>, 1, Time, #[prost(message, optional, tag = "1")];
        parent_frame_id: String, 2, Text, #[prost(string, tag = "2")];
        child_frame_id: String, 3, Text, #[prost(string, tag = "3")];
        translation: Option<Vector3>, 4, Of("Vector3"), #[prost(message, optional, tag = "4")];
        rotation: Option<Quaternion>, 5, Of("Quaternion"), #[prost(message, optional, tag = "5")];
    }
    Foxglove CameraCalibration {
        timestamp: Option<Timestamp>, 1, Time, #[prost(message, optional, tag = "1")];
        frame_id: String, 9, Text, #[prost(string, tag = "9")];
        width: u32, 2, Fixed32, #[prost(fixed32, tag = "2")];
        height: u32, 3, Fixed32, #[prost(fixed32, tag = "3")];
        distortion_model: String, 4, Text, #[prost(string, tag = "4")];
        D: Vec<f64>, 5, Many(&Double), #[prost(double, repeated, tag = "5")];
        K: Vec<f64>, 6, Many(&Double), #[prost(double, repeated, tag = "6")];
        R: Vec<f64>, 7, Many(&Double), #[prost(double, repeated, tag = "7")];
        P: Vec<f64>, 8, Many(&Double), #[prost(double, repeated, tag = "8")];
    }
    Foxglove Point2 {
        x: f64, 1, Double, #[prost(double, tag = "1")];
        y: f64, 2, Double, #[prost(double, tag = "2")];
    }
    Foxglove Color {
        r: f64, 1, Double, #[prost(double, tag = "1")];
        g: f64, 2, Double, #[prost(double, tag = "2")];
        b: f64, 3, Double, #[prost(double, tag = "3")];
        a: f64, 4, Double, #[prost(double, tag = "4")];
    }
    Foxglove CircleAnnotation {
        timestamp: Option<Timestamp>, 1, Time, #[prost(message, optional, tag = "1")];
        position: Option<Point2>, 2, Of("Point2"), #[prost(message, optional, tag = "2")];
        diameter: f64, 3, Double, #[prost(double, tag = "3")];
        thickness: f64, 4, Double, #[prost(double, tag = "4")];
        fill_color: Option<Color>, 5, Of("Color"), #[prost(message, optional, tag = "5")];
        outline_color: Option<Color>, 6, Of("Color"), #[prost(message, optional, tag = "6")];
    }
    Foxglove PointsAnnotation {
        timestamp: Option<Timestamp>, 1, Time, #[prost(message, optional, tag = "1")];
        r#type: i32, 2, PointsType, #[prost(int32, tag = "2")];
        points: Vec<Point2>, 3, Many(&Of("Point2")), #[prost(message, repeated, tag = "3")];
        outline_color: Option<Color>, 4, Of("Color"), #[prost(message, optional, tag = "4")];
        outline_colors: Vec<Color>, 5, Many(&Of("Color")), #[prost(message, repeated, tag = "5")];
        fill_color: Option<Color>, 6, Of("Color"), #[prost(message, optional, tag = "6")];
        thickness: f64, 7, Double, #[prost(double, tag = "7")];
    }
    Foxglove TextAnnotation {
        timestamp: Option<Timestamp>, 1, Time, #[prost(message, optional, tag = "1")];
        position: Option<Point2>, 2, Of("Point2"), #[prost(message, optional, tag = "2")];
        text: String, 3, Text, #[prost(string, tag = "3")];
        font_size: f64, 4, Double, #[prost(double, tag = "4")];
        text_color: Option<Color>, 5, Of("Color"), #[prost(message, optional, tag = "5")];
        background_color: Option<Color>, 6, Of("Color"), #[prost(message, optional, tag = "6")];
    }
    Foxglove ImageAnnotations {
        circles: Vec<CircleAnnotation>, 1, Many(&Of("CircleAnnotation")), #[prost(message, repeated, tag = "1")];
        points: Vec<PointsAnnotation>, 2, Many(&Of("PointsAnnotation")), #[prost(message, repeated, tag = "2")];
        texts: Vec<TextAnnotation>, 3, Many(&Of("TextAnnotation")), #[prost(message, repeated, tag = "3")];
    }
    Netpose Estimate {
        timestamp: Option<Timestamp>, 1, Time, #[prost(message, optional, tag = "1")];
        frame: u64, 2, Uint64, #[prost(uint64, tag = "2")];
        status: String, 3, Text, #[prost(string, tag = "3")];
        probability: f64, 4, Double, #[prost(double, tag = "4")];
        range_m: f64, 5, Double, #[prost(double, tag = "5")];
        distance_m: f64, 6, Double, #[prost(double, tag = "6")];
        tilt_deg: f64, 7, Double, #[prost(double, tag = "7")];
        sigma_range_m: f64, 8, Double, #[prost(double, tag = "8")];
        sigma_tilt_deg: f64, 9, Double, #[prost(double, tag = "9")];
        sigma_xy_m: f64, 10, Double, #[prost(double, tag = "10")];
        junctions: u64, 11, Uint64, #[prost(uint64, tag = "11")];
        latency_ms: f64, 12, Double, #[prost(double, tag = "12")];
    }
}

/// `PointsAnnotation.Type`.
pub(super) const POINTS: i32 = 1;
/// `PointsAnnotation.Type`.
pub(super) const LINE_LIST: i32 = 4;

/// Everything that a reader needs to know of these types: a `FileDescriptorSet`, as MCAP wants it for a protobuf schema.
pub(super) fn descriptors() -> Vec<u8> {
    let time = FileDescriptorProto {
        name: Some("google/protobuf/timestamp.proto".to_owned()),
        package: Some("google.protobuf".to_owned()),
        message_type: vec![DescriptorProto {
            name: Some("Timestamp".to_owned()),
            field: vec![scalar("seconds", 1, Type::Int64), scalar("nanos", 2, Type::Int32)],
            ..DescriptorProto::default()
        }],
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    };
    let file = |package: Package, name: &str| FileDescriptorProto {
        name: Some(format!("{name}.proto")),
        package: Some(name.to_owned()),
        dependency: vec!["google/protobuf/timestamp.proto".to_owned()],
        message_type: MESSAGES.iter().filter(|m| m.0 == package).map(message).collect(),
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    };
    let set =
        FileDescriptorSet { file: vec![time, file(Package::Foxglove, "foxglove"), file(Package::Netpose, "netpose")] };
    set.encode_to_vec()
}

fn message(&(_, name, fields): &(Package, &str, &[(&str, i32, Kind)])) -> DescriptorProto {
    let values = ["UNKNOWN", "POINTS", "LINE_LOOP", "LINE_STRIP", "LINE_LIST"];
    let value = |(number, name): (i32, &&str)| EnumValueDescriptorProto {
        name: Some((*name).to_owned()),
        number: Some(number),
        ..EnumValueDescriptorProto::default()
    };
    let enumeration = EnumDescriptorProto {
        name: Some("Type".to_owned()),
        value: (0..).zip(&values).map(value).collect(),
        ..EnumDescriptorProto::default()
    };
    DescriptorProto {
        name: Some(name.to_owned()),
        field: fields.iter().map(|(name, number, kind)| field(name.trim_start_matches("r#"), *number, kind)).collect(),
        enum_type: if name == "PointsAnnotation" { vec![enumeration] } else { Vec::new() },
        ..DescriptorProto::default()
    }
}

fn field(name: &str, number: i32, kind: &Kind) -> FieldDescriptorProto {
    let named =
        |t: Type, type_name: String| FieldDescriptorProto { type_name: Some(type_name), ..scalar(name, number, t) };
    match kind {
        Double => scalar(name, number, Type::Double),
        Fixed32 => scalar(name, number, Type::Fixed32),
        Uint64 => scalar(name, number, Type::Uint64),
        Text => scalar(name, number, Type::String),
        Of(message) => named(Type::Message, format!(".foxglove.{message}")),
        Time => named(Type::Message, ".google.protobuf.Timestamp".to_owned()),
        PointsType => named(Type::Enum, ".foxglove.PointsAnnotation.Type".to_owned()),
        Many(kind) => FieldDescriptorProto { label: Some(Label::Repeated.into()), ..field(name, number, kind) },
    }
}

fn scalar(name: &str, number: i32, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        ..FieldDescriptorProto::default()
    }
}
