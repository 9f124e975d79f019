//! The columns of the Parquet output: values as they are sent, gathered by type.

use std::sync::Arc;

use arrow_array::builder::StringBuilder;
use arrow_array::types::{
    ArrowPrimitiveType, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type,
    UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, ListArray, PrimitiveArray};
use arrow_buffer::OffsetBuffer;
use arrow_schema::{DataType, Field};
use hums_dialect::Kind;

use crate::mavlink::values::{Scalar, Value};

/// One field's values.
#[derive(Debug)]
pub struct Column {
    values: Values,
    /// Elements of an array; 0 for a scalar.
    array: usize,
}

#[derive(Debug)]
enum Values {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    U64(Vec<u64>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
    Text(TextColumn),
}

/// Text; what is not UTF-8 gets replacement characters.
#[derive(Debug, Default)]
pub struct TextColumn(StringBuilder);

impl TextColumn {
    /// Adds one.
    pub fn push(&mut self, text: &[u8]) {
        self.0.append_value(String::from_utf8_lossy(text));
    }

    /// All of them.
    pub fn array(mut self) -> ArrayRef {
        Arc::new(self.0.finish())
    }
}

impl Column {
    /// For the values of this field.
    pub fn of(field: &hums_dialect::Field) -> Self {
        let values = match field.kind {
            Kind::U8 => Values::U8(Vec::new()),
            Kind::I8 => Values::I8(Vec::new()),
            Kind::U16 => Values::U16(Vec::new()),
            Kind::I16 => Values::I16(Vec::new()),
            Kind::U32 => Values::U32(Vec::new()),
            Kind::I32 => Values::I32(Vec::new()),
            Kind::U64 => Values::U64(Vec::new()),
            Kind::I64 => Values::I64(Vec::new()),
            Kind::F32 => Values::F32(Vec::new()),
            Kind::F64 => Values::F64(Vec::new()),
            Kind::Char => Values::Text(TextColumn::default()),
        };
        let array = if field.kind == Kind::Char { 0 } else { usize::from(field.array) };
        Self { values, array }
    }

    /// Its type: of an array field a list.
    pub fn data_type(&self) -> DataType {
        let element = match self.values {
            Values::U8(_) => DataType::UInt8,
            Values::I8(_) => DataType::Int8,
            Values::U16(_) => DataType::UInt16,
            Values::I16(_) => DataType::Int16,
            Values::U32(_) => DataType::UInt32,
            Values::I32(_) => DataType::Int32,
            Values::U64(_) => DataType::UInt64,
            Values::I64(_) => DataType::Int64,
            Values::F32(_) => DataType::Float32,
            Values::F64(_) => DataType::Float64,
            Values::Text(_) => DataType::Utf8,
        };
        if self.array == 0 { element } else { DataType::List(element_field(element)) }
    }

    /// Adds a value of this field.
    pub fn push(&mut self, value: Value<'_>) {
        match (value, &mut self.values) {
            (Value::Text(text), Values::Text(column)) => column.push(text),
            (Value::Scalar(scalar), values) => values.push(scalar),
            (Value::Array(array), values) => array.iter().for_each(|scalar| values.push(scalar)),
            // A field is text or it is not: its definition says so once.
            (Value::Text(_), _) => {}
        }
    }

    /// All of them.
    pub fn array(self) -> ArrayRef {
        let array = self.array;
        match self.values {
            Values::U8(values) => list::<UInt8Type>(values, array),
            Values::I8(values) => list::<Int8Type>(values, array),
            Values::U16(values) => list::<UInt16Type>(values, array),
            Values::I16(values) => list::<Int16Type>(values, array),
            Values::U32(values) => list::<UInt32Type>(values, array),
            Values::I32(values) => list::<Int32Type>(values, array),
            Values::U64(values) => list::<UInt64Type>(values, array),
            Values::I64(values) => list::<Int64Type>(values, array),
            Values::F32(values) => list::<Float32Type>(values, array),
            Values::F64(values) => list::<Float64Type>(values, array),
            Values::Text(column) => column.array(),
        }
    }
}

impl Values {
    fn push(&mut self, scalar: Scalar) {
        match (self, scalar) {
            (Self::U8(column), Scalar::Unsigned(value)) => column.push(value as u8),
            (Self::U16(column), Scalar::Unsigned(value)) => column.push(value as u16),
            (Self::U32(column), Scalar::Unsigned(value)) => column.push(value as u32),
            (Self::U64(column), Scalar::Unsigned(value)) => column.push(value),
            (Self::I8(column), Scalar::Signed(value)) => column.push(value as i8),
            (Self::I16(column), Scalar::Signed(value)) => column.push(value as i16),
            (Self::I32(column), Scalar::Signed(value)) => column.push(value as i32),
            (Self::I64(column), Scalar::Signed(value)) => column.push(value),
            (Self::F32(column), Scalar::Single(value)) => column.push(value),
            (Self::F64(column), Scalar::Double(value)) => column.push(value),
            // The reader of payloads gives each kind its own type; a test holds it to that.
            _ => {}
        }
    }
}

fn element_field(element: DataType) -> Arc<Field> {
    Arc::new(Field::new("element", element, false))
}

/// Values as an array, or as a list of `length` each.
fn list<T: ArrowPrimitiveType>(values: Vec<T::Native>, length: usize) -> ArrayRef
where
    PrimitiveArray<T>: From<Vec<T::Native>>,
{
    if length == 0 {
        return Arc::new(PrimitiveArray::<T>::from(values));
    }
    let rows = values.len() / length;
    let values = PrimitiveArray::<T>::from(values);
    let field = element_field(values.data_type().clone());
    let offsets = OffsetBuffer::from_lengths(std::iter::repeat_n(length, rows));
    Arc::new(ListArray::new(field, offsets, Arc::new(values), None))
}
