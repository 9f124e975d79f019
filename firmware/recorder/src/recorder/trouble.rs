//! Consequences of card errors for recording and for the pilot.

use crate::card::CardError;
use crate::layout::{EXFAT_TYPE, LayoutError};
use crate::status::CardState;
use crate::{CardDevice, Trouble};

pub(super) fn state<D: CardDevice>(error: &CardError<D::Error>) -> CardState {
    match error {
        CardError::Device(error) => match D::trouble(error) {
            Trouble::Gone => CardState::Absent,
            Trouble::Locked => CardState::Locked,
            Trouble::Stuck | Trouble::Refusing => CardState::Failing,
        },
        CardError::Foreign(LayoutError::NoPartitionTable) => CardState::Unpartitioned,
        CardError::Foreign(LayoutError::NotFat32(EXFAT_TYPE)) => CardState::ExFat,
        CardError::Foreign(LayoutError::NotFat32(_) | LayoutError::Device(_)) => CardState::Foreign,
        CardError::Foreign(LayoutError::BadVolume(_)) | CardError::Damaged => CardState::Damaged,
        CardError::Full => CardState::Full,
        CardError::NotFound | CardError::NotOpen | CardError::Searching => CardState::Failing,
    }
}

/// Another try on this card, if need be in a new segment.
pub(super) fn may_work_elsewhere<D: CardDevice>(error: &CardError<D::Error>) -> bool {
    match error {
        CardError::Full | CardError::Searching => false,
        CardError::Device(error) => D::trouble(error) == Trouble::Refusing,
        _ => true,
    }
}
