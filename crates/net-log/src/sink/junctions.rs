//! `junctions.parquet`: `frame, u, v, i, j, sigma_px, state`, one row per junction.
//!
//! The file is whole between any two writes: rows go into it in groups, and a group is written together with a new footer over the
//! old one, in one piece. What the old footer was is put down beside the file first, so that a process that is killed within that
//! write, or a disk that fills up, costs this group only: [`recover`] puts the old footer back.

mod pieces;
mod reader;
mod writer;

use std::path::Path;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::errors::ParquetError;
use parquet::schema::types::{Type, TypePtr};

use crate::error::Error;

pub(crate) use pieces::{journal, recover};
pub use reader::{Junctions, read_junctions};
pub use writer::JunctionsParquet;

/// The columns, in the contract's order.
fn schema() -> TypePtr {
    let column = |name, physical, repetition, logical| {
        let built =
            Type::primitive_type_builder(name, physical).with_repetition(repetition).with_logical_type(logical).build();
        // These seven are valid, which every test of this file shows.
        Arc::new(built.expect("a valid column"))
    };
    let (required, optional) = (Repetition::REQUIRED, Repetition::OPTIONAL);
    let columns = vec![
        column("frame", Physical::INT64, required, None),
        column("u", Physical::DOUBLE, required, None),
        column("v", Physical::DOUBLE, required, None),
        column("i", Physical::INT32, optional, None),
        column("j", Physical::INT32, optional, None),
        column("sigma_px", Physical::DOUBLE, required, None),
        column("state", Physical::BYTE_ARRAY, required, Some(LogicalType::String)),
    ];
    Arc::new(Type::group_type_builder("junctions").with_fields(columns).build().expect("a valid schema"))
}

/// For `map_err`.
fn failed(action: &'static str, path: &Path) -> impl Fn(ParquetError) -> Error + use<> {
    let path = path.to_owned();
    move |error| match error {
        ParquetError::External(e) => {
            let source = e.downcast::<std::io::Error>().map_or_else(std::io::Error::other, |e| *e);
            Error::Io { action, path: path.clone(), source }
        }
        other => Error::Damaged { path: path.clone(), why: other.to_string() },
    }
}
