#pragma once
// Lines of numbers: XYZ, XYZN, XYZRGB, PTS, CSV and their kin.

#include <cstddef>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"
#include "engine/io/columns.h"

namespace pointwright {

/// The bytes are text and the first line that is no comment holds three numbers or more, or is a line with
/// the count or the columns' names before such a line.
bool looks_like_xyz(std::span<const std::byte> bytes);

/// Lines of numbers parted by blanks, commas or semicolons; '#', '//', '%' and '!' start comments; a first
/// line with one whole number is the count of samples (checked); a first line (or comment) with as many words
/// as there are columns, x, y and z among them, names the columns. Without names: x y z; six columns are x y
/// z and a unit normal, or x y z and colours of 0..255; further columns become scalars "column_4", …. Numbers
/// that say no more than a float32 does are kept as float32, all others as float64, column by column.
/// Errors: kMalformedData (with the line), kTooLarge, kEmptyCloud
Result<ImportedCloud> read_xyz(std::span<const std::byte> bytes, const ImportParams& params);

/// Shortest numbers that read back to the same bits; a comment line with the columns' names where there are
/// more than x y z. The types of scalars are lost; their values are not.
std::vector<std::byte> write_xyz(const ExportView& view);

}  // namespace pointwright
