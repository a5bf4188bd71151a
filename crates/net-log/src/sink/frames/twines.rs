//! `twines.parquet`: `frame, i, j, direction, state, llr, contrast, width_px`, one row per twine.

use net_geometry::{Twine, TwineState};
use parquet::basic::{LogicalType, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, FloatType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::reader::RowGroupReader;
use parquet::file::writer::SerializedColumnWriter;
use parquet::schema::types::TypePtr;

use super::{FrameRow, column, field, unknown_state};
use crate::error::Result;

/// Numbers are written in steps of one part of so many: finer ones mean nothing, and take three times the room.
const STEPS: f32 = 64.0;

/// The rows of a group by column.
#[derive(Debug, Default)]
pub struct Columns {
    i: Vec<i32>,
    j: Vec<i32>,
    direction: Vec<i32>,
    state: Vec<ByteArray>,
    llr: Vec<f32>,
    contrast: Vec<f32>,
    /// Only of twines that have one.
    width_px: Vec<f32>,
    /// For every row: 1 with a width, 0 without.
    measured: Vec<i16>,
}

impl FrameRow for Twine {
    type Columns = Columns;
    const TABLE: &'static str = "twines";
    const NAMES: &'static str = "frame, i, j, direction, state, llr, contrast, width_px";

    fn fields() -> Vec<TypePtr> {
        vec![
            field("i", Physical::INT32, true, None),
            field("j", Physical::INT32, true, None),
            field("direction", Physical::INT32, true, None),
            field("state", Physical::BYTE_ARRAY, true, Some(LogicalType::String)),
            field("llr", Physical::FLOAT, true, None),
            field("contrast", Physical::FLOAT, true, None),
            field("width_px", Physical::FLOAT, false, None),
        ]
    }

    fn check(&self) -> Result<()> {
        Ok(())
    }

    fn push(&self, columns: &mut Columns) {
        let step = |value: f32| (value * STEPS).round() / STEPS;
        columns.i.push(self.index.0);
        columns.j.push(self.index.1);
        columns.direction.push(i32::from(self.direction != 0));
        columns.state.push(ByteArray::from(self.state.as_str()));
        columns.llr.push(step(self.llr));
        columns.contrast.push(step(self.contrast));
        columns.width_px.extend(self.width_px.map(step));
        columns.measured.push(i16::from(self.width_px.is_some()));
    }

    fn clear(columns: &mut Columns) {
        let Columns { i, j, direction, state, llr, contrast, width_px, measured } = columns;
        [i, j, direction].into_iter().for_each(Vec::clear);
        [llr, contrast, width_px].into_iter().for_each(Vec::clear);
        state.clear();
        measured.clear();
    }

    fn write(
        columns: &Columns,
        index: usize,
        writer: &mut SerializedColumnWriter<'_>,
    ) -> parquet::errors::Result<usize> {
        match index {
            0 => writer.typed::<Int32Type>().write_batch(&columns.i, None, None),
            1 => writer.typed::<Int32Type>().write_batch(&columns.j, None, None),
            2 => writer.typed::<Int32Type>().write_batch(&columns.direction, None, None),
            3 => writer.typed::<ByteArrayType>().write_batch(&columns.state, None, None),
            4 => writer.typed::<FloatType>().write_batch(&columns.llr, None, None),
            5 => writer.typed::<FloatType>().write_batch(&columns.contrast, None, None),
            _ => writer.typed::<FloatType>().write_batch(&columns.width_px, Some(&columns.measured), None),
        }
    }

    fn read(group: &dyn RowGroupReader, count: usize) -> parquet::errors::Result<Vec<Self>> {
        let (i, _) = column::<Int32Type>(group, 1, count)?;
        let (j, _) = column::<Int32Type>(group, 2, count)?;
        let (direction, _) = column::<Int32Type>(group, 3, count)?;
        let (state, _) = column::<ByteArrayType>(group, 4, count)?;
        let (llr, _) = column::<FloatType>(group, 5, count)?;
        let (contrast, _) = column::<FloatType>(group, 6, count)?;
        let (width_px, measured) = column::<FloatType>(group, 7, count)?;
        let mut widths = width_px.into_iter();
        (0..count)
            .map(|row| {
                let direction = match direction[row] {
                    0 => 0,
                    1 => 1,
                    other => return Err(ParquetError::General(format!("direction {other} is neither 0 nor 1"))),
                };
                let word = state[row].as_utf8()?;
                let state =
                    TwineState::ALL.into_iter().find(|s| s.as_str() == word).ok_or_else(|| unknown_state(word))?;
                let width_px = if measured.get(row) == Some(&1) { widths.next() } else { None };
                let (index, llr, contrast) = ((i[row], j[row]), llr[row], contrast[row]);
                Ok(Self { index, direction, state, llr, contrast, width_px })
            })
            .collect()
    }
}
