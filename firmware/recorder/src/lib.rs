//! Log files on a FAT card, written through embedded-sdmmc.
