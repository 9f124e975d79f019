//! Columns of tables, read and written with their levels, for any type.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use parquet::basic::{ConvertedType, Encoding};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{BoolType, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::errors::Result as ParquetResult;
use parquet::file::metadata::{KeyValue, ParquetMetaData};
use parquet::file::properties::WriterPropertiesBuilder;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{ColumnPath, SchemaDescriptor, Type, TypePtr};

use super::super::session_of;
use super::Rows;

const SAMPLE_ROWS: usize = 32 * 1024;
const NAMES: [&str; 2] = ["vehicle", "session"];
const NAMES_AT_ONCE: usize = 64 * 1024;

#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub(super) vehicle: String,
    pub(super) session: String,
    pub(super) part: u32,
    pub(super) from: usize,
    pub(super) rows: usize,
}

pub(super) struct Input {
    path: PathBuf,
    metadata: Arc<ParquetMetaData>,
    segments: Vec<Segment>,
}

impl Input {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let context = || format!("{}: cannot be read as a table", path.display());
        let file = File::open(path).with_context(context)?;
        let reader = SerializedFileReader::new(file).with_context(context)?;
        let metadata = Arc::new(reader.metadata().clone());
        let fields = metadata.file_metadata().schema().get_fields().to_vec();
        let is_ours = fields.iter().zip(NAMES).filter(|(field, name)| field.name() == *name).count() == 2;
        if !is_ours || fields.len() != metadata.file_metadata().schema_descr().num_columns() {
            bail!("{}: has not the columns of a table of hums; move it out of the folder", path.display());
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let part = name.split('.').nth(1).and_then(|part| part.parse().ok()).unwrap_or(1);
        let mut input = Self { path: path.to_owned(), metadata, segments: Vec::new() };
        input.segments = input.find_segments(part).with_context(context)?;
        let own = session_of(&name);
        if own.is_some_and(|own| input.segments.iter().any(|segment| segment.session != own)) {
            bail!("{}: has rows of another session; move it away", path.display());
        }
        Ok(input)
    }

    fn find_segments(&self, part: u32) -> Result<Vec<Segment>> {
        let mut segments: Vec<Segment> = Vec::new();
        for from in (0..self.rows()).step_by(NAMES_AT_ONCE) {
            let rows = NAMES_AT_ONCE.min(self.rows() - from);
            let read = |column| read(std::slice::from_ref(self), &[(0, from, rows)], column);
            let (Column::Texts(vehicles), Column::Texts(sessions)) = (read(0)?, read(1)?) else {
                bail!("the columns vehicle and session are not texts; move it out of the folder");
            };
            for (row, (vehicle, session)) in vehicles.present.iter().zip(&sessions.present).enumerate() {
                match segments.last_mut() {
                    Some(last)
                        if last.session.as_bytes() == session.data()
                            && last.vehicle.as_bytes() == vehicle.data() =>
                    {
                        last.rows += 1;
                    }
                    _ => segments.push(Segment {
                        vehicle: vehicle.as_utf8()?.to_owned(),
                        session: session.as_utf8()?.to_owned(),
                        part,
                        from: from + row,
                        rows: 1,
                    }),
                }
            }
        }
        Ok(segments)
    }

    pub(super) fn segments(&self) -> &[Segment] {
        &self.segments
    }

    pub(super) fn rows(&self) -> usize {
        self.metadata.file_metadata().num_rows() as usize
    }

    /// Values of a row in the column that has the most of them, on average, rounded up; at least one.
    pub(super) fn values_of_row(&self) -> usize {
        let of_column = |column: usize| -> usize {
            let groups = self.metadata.row_groups().iter();
            groups.filter_map(|group| Some(group.columns().get(column)?.num_values() as usize)).sum()
        };
        let most = (0..self.columns()).map(of_column).max().unwrap_or(0);
        most.div_ceil(self.rows().max(1)).max(1)
    }

    pub(super) fn columns(&self) -> usize {
        self.metadata.file_metadata().schema_descr().num_columns()
    }

    pub(super) fn schema(&self) -> Type {
        self.metadata.file_metadata().schema().clone()
    }

    pub(super) fn about(&self) -> &[KeyValue] {
        self.metadata.file_metadata().key_value_metadata().map_or(&[], Vec::as_slice)
    }
}

pub(super) struct Values<T: DataType> {
    present: Vec<T::T>,
    definition: Vec<i16>,
    repetition: Vec<i16>,
}

impl<T: DataType> Default for Values<T> {
    fn default() -> Self {
        Self { present: Vec::new(), definition: Vec::new(), repetition: Vec::new() }
    }
}

/// A column's values.
pub(super) enum Column {
    Flags(Values<BoolType>),
    Integers(Values<Int32Type>),
    Longs(Values<Int64Type>),
    Singles(Values<FloatType>),
    Doubles(Values<DoubleType>),
    Texts(Values<ByteArrayType>),
}

pub(super) fn read(inputs: &[Input], rows: &[Rows], column: usize) -> Result<Column> {
    let mut all = None;
    for (index, from, count) in rows {
        let Some(input) = inputs.get(*index) else {
            bail!("a file of the tables is missing; decode its session again")
        };
        let context = || format!("{}: cannot be read", input.path.display());
        let file = File::open(&input.path).with_context(context)?;
        let reader = SerializedFileReader::new(file).with_context(context)?;
        let (mut skip, mut left) = (*from, *count);
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group).with_context(context)?;
            let rows = group.metadata().num_rows() as usize;
            if skip >= rows {
                skip -= rows;
                continue;
            }
            let some = left.min(rows - skip);
            let reader = group.get_column_reader(column).with_context(context)?;
            append(&mut all, reader, skip, some).with_context(context)?;
            (skip, left) = (0, left - some);
            if left == 0 {
                break;
            }
        }
        if left > 0 {
            bail!("{}: ends {left} rows early; decode its session again", input.path.display());
        }
    }
    all.context("no file has rows of this column; decode the sessions again")
}

fn append(all: &mut Option<Column>, reader: ColumnReader, skip: usize, rows: usize) -> Result<()> {
    macro_rules! append {
        ($kind:ident, $reader:expr) => {
            match all.get_or_insert_with(|| Column::$kind(Values::default())) {
                Column::$kind(values) => values.append($reader, skip, rows),
                _ => bail!("a column has another type than in other files; decode its session again"),
            }
        };
    }
    match reader {
        ColumnReader::BoolColumnReader(reader) => append!(Flags, reader),
        ColumnReader::Int32ColumnReader(reader) => append!(Integers, reader),
        ColumnReader::Int64ColumnReader(reader) => append!(Longs, reader),
        ColumnReader::FloatColumnReader(reader) => append!(Singles, reader),
        ColumnReader::DoubleColumnReader(reader) => append!(Doubles, reader),
        ColumnReader::ByteArrayColumnReader(reader) => append!(Texts, reader),
        _ => bail!("a column has a type that tables of hums do not have; move it out of the folder"),
    }
}

impl<T: DataType> Values<T> {
    fn append(&mut self, mut reader: ColumnReaderImpl<T>, skip: usize, rows: usize) -> Result<()> {
        if skip > 0 && reader.skip_records(skip)? != skip {
            bail!("a column ends early; decode its session again");
        }
        let mut left = rows;
        while left > 0 {
            let (definition, repetition) = (&mut self.definition, &mut self.repetition);
            let (read, ..) =
                reader.read_records(left, Some(definition), Some(repetition), &mut self.present)?;
            if read == 0 {
                bail!("a column ends early; decode its session again");
            }
            left -= read;
        }
        Ok(())
    }

    fn write(&self, writer: &mut SerializedColumnWriter<'_>) -> ParquetResult<()> {
        let levels = |levels: &'_ Vec<i16>| if levels.is_empty() { None } else { Some(levels.clone()) };
        let (definition, repetition) = (levels(&self.definition), levels(&self.repetition));
        let writer = writer.typed::<T>();
        writer.write_batch(&self.present, definition.as_deref(), repetition.as_deref()).map(|_| ())
    }

    /// The first rows.
    fn sample(&self) -> Self {
        let some = |levels: &[i16]| levels.get(..SAMPLE_ROWS.min(levels.len())).unwrap_or_default().to_vec();
        let (mut definition, mut repetition) = (some(&self.definition), some(&self.repetition));
        // No list is cut.
        if let Some(begin) = repetition.iter().rposition(|level| *level == 0).filter(|begin| *begin > 0) {
            definition.truncate(begin);
            repetition.truncate(begin);
        }
        let most = definition.iter().copied().max().unwrap_or(0);
        let values = match definition.len() {
            0 => SAMPLE_ROWS,
            _ if most == 0 => 0,
            _ => definition.iter().filter(|level| **level == most).count(),
        };
        let present = self.present.get(..values.min(self.present.len())).unwrap_or_default().to_vec();
        Self { present, definition, repetition }
    }

    fn encoded(
        &self,
        schema: &TypePtr,
        column: usize,
        encodings: &[Encoding],
        properties: WriterPropertiesBuilder,
    ) -> Result<WriterPropertiesBuilder> {
        let field =
            schema.get_fields().get(column).context("a column is missing; decode its session again")?;
        let one = Type::group_type_builder("hums").with_fields(vec![field.clone()]).build()?;
        let one = Arc::new(one);
        let leaf = SchemaDescriptor::new(one.clone()).column(0);
        let path = leaf.path().clone();
        // Spark 4.3 does not read such integers with this encoding.
        let is_unread = |encoding: &&Encoding| {
            **encoding == Encoding::BYTE_STREAM_SPLIT
                && matches!(leaf.converted_type(), ConvertedType::UINT_32 | ConvertedType::UINT_64)
        };
        let sample = self.sample();
        let mut best = None;
        for encoding in encodings.iter().filter(|encoding| !is_unread(encoding)) {
            let with = |properties| encode(properties, &path, *encoding);
            let mut bytes = Vec::new();
            let properties = Arc::new(with(super::base()).build());
            let mut writer = SerializedFileWriter::new(&mut bytes, one.clone(), properties)?;
            let mut group = writer.next_row_group()?;
            if let Some(mut column) = group.next_column()? {
                sample.write(&mut column)?;
                column.close()?;
            }
            group.close()?;
            writer.close()?;
            if best.is_none_or(|(least, _)| bytes.len() < least) {
                best = Some((bytes.len(), *encoding));
            }
        }
        Ok(best.map_or(properties.clone(), |(_, encoding)| encode(properties, &path, encoding)))
    }
}

fn encode(
    properties: WriterPropertiesBuilder,
    path: &ColumnPath,
    encoding: Encoding,
) -> WriterPropertiesBuilder {
    match encoding {
        Encoding::RLE_DICTIONARY => properties.set_column_dictionary_enabled(path.clone(), true),
        encoding => properties.set_column_encoding(path.clone(), encoding),
    }
}

impl Column {
    pub(super) fn write(&self, writer: &mut SerializedColumnWriter<'_>) -> Result<()> {
        match self {
            Self::Flags(values) => values.write(writer),
            Self::Integers(values) => values.write(writer),
            Self::Longs(values) => values.write(writer),
            Self::Singles(values) => values.write(writer),
            Self::Doubles(values) => values.write(writer),
            Self::Texts(values) => values.write(writer),
        }
        .map_err(Into::into)
    }

    pub(super) fn encoded(
        &self,
        schema: &TypePtr,
        column: usize,
        properties: WriterPropertiesBuilder,
    ) -> Result<WriterPropertiesBuilder> {
        use Encoding::{
            BYTE_STREAM_SPLIT, DELTA_BINARY_PACKED, DELTA_BYTE_ARRAY, DELTA_LENGTH_BYTE_ARRAY, PLAIN,
            RLE_DICTIONARY,
        };
        let whole = [PLAIN, RLE_DICTIONARY, DELTA_BINARY_PACKED, BYTE_STREAM_SPLIT];
        let real = [PLAIN, RLE_DICTIONARY, BYTE_STREAM_SPLIT];
        let text = [PLAIN, RLE_DICTIONARY, DELTA_BYTE_ARRAY, DELTA_LENGTH_BYTE_ARRAY];
        match self {
            Self::Flags(_) => Ok(properties),
            Self::Integers(values) => values.encoded(schema, column, &whole, properties),
            Self::Longs(values) => values.encoded(schema, column, &whole, properties),
            Self::Singles(values) => values.encoded(schema, column, &real, properties),
            Self::Doubles(values) => values.encoded(schema, column, &real, properties),
            Self::Texts(values) => values.encoded(schema, column, &text, properties),
        }
    }
}
