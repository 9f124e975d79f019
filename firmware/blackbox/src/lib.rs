//! The record: its format, its writer and its reader.
