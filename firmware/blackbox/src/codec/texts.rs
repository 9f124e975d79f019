//! Text and data fields: the last text of each is stored while there is room.

use super::element::Element;
use super::text::TextModel;
use crate::coder::Coder;
use crate::distribution::Cdf;

const TEXT_BYTES: usize = 1_024;

const TEXT_BYTES_MAX: usize = 255;

const NOT_KEPT: u32 = u32::MAX;

#[derive(zerocopy::FromZeros)]
pub(super) struct Texts {
    pub(super) model: TextModel,
    kept: [u8; TEXT_BYTES],
    used: u16,
    changes: Cdf,
    lengths: [Cdf; 2],
}

impl Texts {
    pub(super) fn reset(&mut self) {
        self.model.reset();
        self.used = 0;
        self.changes = Cdf::FLAT;
        self.lengths = [Cdf::FLAT; 2];
    }

    pub(super) fn last(&self, element: &Element) -> Option<&[u8]> {
        self.kept.get(range_of(element)?)
    }

    pub(super) fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        text: &mut [u8],
    ) -> Option<()> {
        if !element.known() {
            self.keep(element, text.len());
        }
        let mut above = [0; TEXT_BYTES_MAX];
        let above = above.get_mut(..text.len())?;
        let last = self.last(element);
        if let Some(last) = last {
            above.copy_from_slice(last);
        }
        let same = last.is_some_and(|last| last == text);
        let same = coder.symbol(&mut self.changes, usize::from(!same)) == 0;
        if same {
            text.copy_from_slice(above);
        } else {
            self.changed(coder, text, above)?;
        }
        element.note(same);
        if let Some(last) = range_of(element).and_then(|range| self.kept.get_mut(range)) {
            last.copy_from_slice(text);
        }
        Some(())
    }

    fn keep(&mut self, element: &mut Element, size: usize) {
        element.aux = NOT_KEPT;
        let at = usize::from(self.used);
        if let Some(place) = self.kept.get_mut(at..at + size) {
            place.fill(0);
            element.aux = at as u32;
            self.used += size as u16;
        }
    }

    fn changed<C: Coder>(&mut self, coder: &mut C, text: &mut [u8], above: &[u8]) -> Option<()> {
        let len = text.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
        let high = coder.symbol(&mut self.lengths[0], len >> 4);
        let len = high << 4 | coder.symbol(&mut self.lengths[1], len & 15);
        let (mut before, mut matched) = (0, 0);
        for (place, &above) in text.get_mut(..len)?.iter_mut().zip(above) {
            *place = self.model.byte_below(coder, *place, before, above, matched);
            matched = if *place == above { matched + 1 } else { 0 };
            before = u32::from(*place);
        }
        text.get_mut(len..)?.fill(0);
        Some(())
    }
}

fn range_of(element: &Element) -> Option<core::ops::Range<usize>> {
    let at = usize::try_from(element.aux).ok()?;
    Some(at..at.checked_add(element.size())?)
}
