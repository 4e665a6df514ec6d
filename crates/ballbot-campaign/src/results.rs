//! Files of results: Parquet, a row per run, in groups of rows whose places do not depend on who
//! wrote them. A file says what it was made of and by, and has a digest of its rows.

use crate::cell::{Cell, Column, Kind, Row};
use crate::error::CampaignError;
use parquet::basic::{ConvertedType, Repetition, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rows of a group: what a reader or a writer has in memory.
pub const GROUP: usize = 1 << 15;

/// The key of the digest in a file.
const DIGEST: &str = "ballbot.rows_sha256";

/// Writes rows into a Parquet file.
pub struct RowWriter<W: Write + Send> {
    writer: SerializedFileWriter<W>,
    columns: Vec<Column>,
    buffer: Vec<Row>,
    digest: Sha256,
    rows: u64,
}

fn schema(columns: &[Column]) -> ParquetResult<TypePtr> {
    let field = |column: &Column| {
        let (physical, converted) = match column.kind {
            Kind::Real => (Physical::DOUBLE, ConvertedType::NONE),
            Kind::Whole => (Physical::INT64, ConvertedType::NONE),
            Kind::Text => (Physical::BYTE_ARRAY, ConvertedType::UTF8),
            Kind::Flag => (Physical::BOOLEAN, ConvertedType::NONE),
        };
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_converted_type(converted);
        field.build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<ParquetResult<_>>()?;
    let group = Type::group_type_builder("run").with_fields(fields);
    group.build().map(Arc::new)
}

impl<W: Write + Send> RowWriter<W> {
    /// A file with these columns, and what it is to say of itself.
    ///
    /// # Errors
    /// `into` does not take what is written.
    pub fn new(
        into: W,
        columns: &[Column],
        notes: &[(&str, String)],
    ) -> Result<Self, ParquetError> {
        let notes = notes
            .iter()
            .map(|(key, value)| KeyValue::new((*key).to_owned(), value.clone()));
        let properties = WriterProperties::builder()
            .set_created_by("ballbot".to_owned())
            // Numbers that were drawn hardly repeat.
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_key_value_metadata(Some(notes.collect()));
        Ok(Self {
            writer: SerializedFileWriter::new(
                into,
                schema(columns)?,
                Arc::new(properties.build()),
            )?,
            columns: columns.to_vec(),
            buffer: Vec::with_capacity(GROUP),
            digest: Sha256::new(),
            rows: 0,
        })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// It is not like the columns, or cannot be written.
    pub fn push(&mut self, row: Row) -> Result<(), ParquetError> {
        self.digest.update(digest_bytes(&row));
        self.rows += 1;
        self.buffer.push(row);
        match self.buffer.len() {
            GROUP => self.flush(),
            _ => Ok(()),
        }
    }

    fn flush(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for (index, column) in self.columns.iter().enumerate() {
            let cells = self
                .buffer
                .iter()
                .map(|row| row.get(index).unwrap_or(&Cell::Missing));
            write_column(&mut group, column, cells)?;
        }
        group.close()?;
        self.buffer.clear();
        Ok(())
    }

    /// Ends the file and returns the rows in it.
    ///
    /// # Errors
    /// The rest cannot be written.
    pub fn finish(mut self) -> Result<u64, ParquetError> {
        if !self.buffer.is_empty() {
            self.flush()?;
        }
        let digest = hexadecimal(&self.digest.finalize());
        self.writer
            .append_key_value_metadata(KeyValue::new(DIGEST.to_owned(), digest));
        self.writer.close()?;
        Ok(self.rows)
    }
}

fn digest_bytes(row: &Row) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(12 * row.len());
    row.iter().for_each(|cell| cell.bytes(&mut bytes));
    bytes
}

/// As text.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn write_column<'a, W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    column: &Column,
    cells: impl Iterator<Item = &'a Cell>,
) -> Result<(), ParquetError> {
    let wrong =
        || ParquetError::General(format!("a value does not fit into column {}", column.name));
    let mut writer = group.next_column()?.ok_or_else(wrong)?;
    let mut there = Vec::with_capacity(GROUP);
    let mut present = Vec::with_capacity(GROUP);
    for cell in cells {
        there.push(i16::from(*cell != Cell::Missing));
        if *cell != Cell::Missing {
            present.push(cell);
        }
    }
    macro_rules! write {
        ($typed:expr, $pattern:pat => $value:expr) => {{
            let values = present.into_iter().map(|cell| match cell {
                $pattern => Ok($value),
                _ => Err(wrong()),
            });
            let values = values.collect::<Result<Vec<_>, _>>()?;
            $typed.write_batch(&values, Some(&there), None)?;
        }};
    }
    match writer.untyped() {
        ColumnWriter::DoubleColumnWriter(typed) => write!(typed, Cell::Real(number) => *number),
        ColumnWriter::Int64ColumnWriter(typed) => write!(typed, Cell::Whole(number) => *number),
        ColumnWriter::BoolColumnWriter(typed) => write!(typed, Cell::Flag(flag) => *flag),
        ColumnWriter::ByteArrayColumnWriter(typed) => {
            write!(typed, Cell::Text(text) => ByteArray::from(text.as_str()));
        }
        _ => return Err(wrong()),
    }
    writer.close()
}

/// A file of results.
pub struct RowFile {
    path: PathBuf,
    reader: SerializedFileReader<File>,
    columns: Vec<Column>,
}

impl RowFile {
    /// Opens a file.
    ///
    /// # Errors
    /// It cannot be read, is cut off, or is no file of results.
    pub fn open(path: &Path) -> Result<Self, CampaignError> {
        let file = File::open(path).map_err(CampaignError::at(path))?;
        let reader = SerializedFileReader::new(file).map_err(CampaignError::unreadable(path))?;
        let fields = reader.metadata().file_metadata().schema_descr().columns();
        let columns = fields.iter().map(|field| {
            let kind = match field.physical_type() {
                Physical::DOUBLE => Kind::Real,
                Physical::INT64 => Kind::Whole,
                Physical::BOOLEAN => Kind::Flag,
                _ => Kind::Text,
            };
            Column::new(field.name(), kind)
        });
        Ok(Self {
            path: path.to_owned(),
            columns: columns.collect(),
            reader,
        })
    }

    /// Its columns.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many rows it has.
    pub fn rows(&self) -> u64 {
        self.reader.metadata().file_metadata().num_rows() as u64
    }

    /// What it says of itself under a key.
    pub fn note(&self, key: &str) -> Option<&str> {
        let notes = self
            .reader
            .metadata()
            .file_metadata()
            .key_value_metadata()?;
        notes.iter().find(|note| note.key == key)?.value.as_deref()
    }

    /// Hands over all rows in their order, and checks at the end that they are as they were written.
    ///
    /// # Errors
    /// The file cannot be read, or was changed; what `each` says.
    pub fn for_each<E: From<CampaignError>>(
        &self,
        mut each: impl FnMut(Row) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut digest = Sha256::new();
        for group in 0..self.reader.num_row_groups() {
            let columns = (0..self.columns.len()).map(|index| self.group(group, index));
            let mut columns = columns
                .map(|column| column.map(Vec::into_iter))
                .collect::<Result<Vec<_>, _>>()?;
            let rows = self.reader.metadata().row_group(group).num_rows();
            for _ in 0..rows {
                let cells = columns
                    .iter_mut()
                    .map(|column| column.next().unwrap_or(Cell::Missing));
                let row: Row = cells.collect();
                digest.update(digest_bytes(&row));
                each(row)?;
            }
        }
        match self.note(DIGEST) {
            Some(expected) if expected == hexadecimal(&digest.finalize()) => Ok(()),
            _ => Err(CampaignError::results(
                &self.path,
                "its rows are not those that were written; remove it and run again",
            )
            .into()),
        }
    }

    /// The first cells of a column, at most so many.
    ///
    /// # Errors
    /// There is no such column, or the file cannot be read.
    pub fn first_cells(&self, name: &str, most: usize) -> Result<Vec<Cell>, CampaignError> {
        let mut cells = Vec::new();
        for group in 0..self.reader.num_row_groups() {
            if cells.len() < most {
                cells.extend(self.group(group, self.index(name)?)?);
            }
        }
        cells.truncate(most);
        Ok(cells)
    }

    /// Hands over the cells of a column, in the order of the rows.
    ///
    /// # Errors
    /// There is no such column, or the file cannot be read.
    pub fn for_each_cell(
        &self,
        name: &str,
        mut each: impl FnMut(Cell),
    ) -> Result<(), CampaignError> {
        let index = self.index(name)?;
        for group in 0..self.reader.num_row_groups() {
            self.group(group, index)?.into_iter().for_each(&mut each);
        }
        Ok(())
    }

    fn index(&self, name: &str) -> Result<usize, CampaignError> {
        let index = self.columns.iter().position(|column| column.name == name);
        index.ok_or_else(|| CampaignError::results(&self.path, format!("it has no column {name}")))
    }

    /// A column of a group of rows.
    fn group(&self, group: usize, index: usize) -> Result<Vec<Cell>, CampaignError> {
        let cells = self.read_group(group, index);
        cells.map_err(CampaignError::unreadable(&self.path))
    }

    fn read_group(&self, group: usize, index: usize) -> ParquetResult<Vec<Cell>> {
        let group = self.reader.get_row_group(group)?;
        let rows = group.metadata().num_rows() as usize;
        macro_rules! read {
            ($typed:expr, $cell:expr) => {{
                let (mut values, mut there) = (Vec::new(), Vec::new());
                while there.len() < rows {
                    let left = rows - there.len();
                    let (read, _, _) =
                        $typed.read_records(left, Some(&mut there), None, &mut values)?;
                    if read == 0 {
                        return Err(ParquetError::General("rows are missing".to_owned()));
                    }
                }
                let mut values = values.into_iter();
                let cells = there.into_iter().map(|there| match there {
                    0 => Ok(Cell::Missing),
                    _ => values.next().map($cell).unwrap_or(Ok(Cell::Missing)),
                });
                cells.collect()
            }};
        }
        match group.get_column_reader(index)? {
            ColumnReader::DoubleColumnReader(mut typed) => {
                read!(typed, |number| Ok(Cell::Real(number)))
            }
            ColumnReader::Int64ColumnReader(mut typed) => {
                read!(typed, |number| Ok(Cell::Whole(number)))
            }
            ColumnReader::BoolColumnReader(mut typed) => read!(typed, |flag| Ok(Cell::Flag(flag))),
            ColumnReader::ByteArrayColumnReader(mut typed) => {
                read!(typed, |bytes: ByteArray| Ok(Cell::Text(
                    bytes.as_utf8()?.to_owned()
                )))
            }
            _ => Err(ParquetError::General("a column of another type".to_owned())),
        }
    }
}
