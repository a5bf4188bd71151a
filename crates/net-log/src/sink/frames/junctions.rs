//! `junctions.parquet`: `frame, u, v, i, j, sigma_px, state`, one row per junction.

use net_geometry::nalgebra::Vector2;
use net_geometry::{Junction, JunctionState};
use parquet::basic::{LogicalType, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type};
use parquet::file::reader::RowGroupReader;
use parquet::file::writer::SerializedColumnWriter;
use parquet::schema::types::TypePtr;

use super::{FrameRow, column, field, unknown_state};
use crate::error::{Error, Result};

/// The rows of a group by column.
#[derive(Debug, Default)]
pub struct Columns {
    u: Vec<f64>,
    v: Vec<f64>,
    /// Only of junctions that have an index.
    i: Vec<i32>,
    j: Vec<i32>,
    /// For every row: 1 with an index, 0 without.
    indexed: Vec<i16>,
    sigma_px: Vec<f64>,
    state: Vec<ByteArray>,
}

impl FrameRow for Junction {
    type Columns = Columns;
    const TABLE: &'static str = "junctions";
    const NAMES: &'static str = "frame, u, v, i, j, sigma_px, state";

    fn fields() -> Vec<TypePtr> {
        vec![
            field("u", Physical::DOUBLE, true, None),
            field("v", Physical::DOUBLE, true, None),
            field("i", Physical::INT32, false, None),
            field("j", Physical::INT32, false, None),
            field("sigma_px", Physical::DOUBLE, true, None),
            field("state", Physical::BYTE_ARRAY, true, Some(LogicalType::String)),
        ]
    }

    fn check(&self) -> Result<()> {
        if self.pixel.x.is_finite() && self.pixel.y.is_finite() {
            return Ok(());
        }
        let value = format!("({}, {})", self.pixel.x, self.pixel.y);
        Err(Error::Value { field: "junction", value, expected: "finite pixels" })
    }

    fn push(&self, columns: &mut Columns) {
        columns.u.push(self.pixel.x);
        columns.v.push(self.pixel.y);
        if let Some((i, j)) = self.index {
            columns.i.push(i);
            columns.j.push(j);
        }
        columns.indexed.push(i16::from(self.index.is_some()));
        columns.sigma_px.push(self.sigma_px);
        columns.state.push(ByteArray::from(self.state.as_str()));
    }

    fn clear(columns: &mut Columns) {
        let Columns { u, v, i, j, indexed, sigma_px, state } = columns;
        [u, v, sigma_px].into_iter().for_each(Vec::clear);
        [i, j].into_iter().for_each(Vec::clear);
        indexed.clear();
        state.clear();
    }

    fn write(
        columns: &Columns,
        index: usize,
        writer: &mut SerializedColumnWriter<'_>,
    ) -> parquet::errors::Result<usize> {
        let present = Some(&columns.indexed[..]);
        match index {
            0 => writer.typed::<DoubleType>().write_batch(&columns.u, None, None),
            1 => writer.typed::<DoubleType>().write_batch(&columns.v, None, None),
            2 => writer.typed::<Int32Type>().write_batch(&columns.i, present, None),
            3 => writer.typed::<Int32Type>().write_batch(&columns.j, present, None),
            4 => writer.typed::<DoubleType>().write_batch(&columns.sigma_px, None, None),
            _ => writer.typed::<ByteArrayType>().write_batch(&columns.state, None, None),
        }
    }

    fn read(group: &dyn RowGroupReader, count: usize) -> parquet::errors::Result<Vec<Self>> {
        let (u, _) = column::<DoubleType>(group, 1, count)?;
        let (v, _) = column::<DoubleType>(group, 2, count)?;
        let (i, indexed) = column::<Int32Type>(group, 3, count)?;
        let (j, _) = column::<Int32Type>(group, 4, count)?;
        let (sigma_px, _) = column::<DoubleType>(group, 5, count)?;
        let (state, _) = column::<ByteArrayType>(group, 6, count)?;
        let mut indices = i.into_iter().zip(j);
        (0..count)
            .map(|row| {
                let index = if indexed.get(row) == Some(&1) { indices.next() } else { None };
                let word = state[row].as_utf8()?;
                let state =
                    JunctionState::ALL.into_iter().find(|s| s.as_str() == word).ok_or_else(|| unknown_state(word))?;
                Ok(Self { pixel: Vector2::new(u[row], v[row]), index, sigma_px: sigma_px[row], state })
            })
            .collect()
    }
}
