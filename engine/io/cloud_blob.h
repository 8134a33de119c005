#pragma once
// A cloud with its import report as bytes, for one process to hand to another on the same machine. Not a file
// format: native byte order, and both ends are the same program.

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"

namespace pointwright {

/// Takes the next piece of a blob.
using BlobSink = std::function<void(std::span<const std::byte>)>;

/// Hands the blob to the sink piece by piece, column by column: nothing is copied.
/// Pre: the columns agree in length.
void write_cloud_blob(const ImportedCloud& imported, const BlobSink& sink);

std::vector<std::byte> cloud_blob(const ImportedCloud& imported);

/// Reads a blob that may come from anywhere: every size is checked against the bytes there are before it is
/// believed; columns agree in length, names are clean, ids are a permutation. Values are not checked (see
/// finish_cloud()).
/// Errors: kMalformedData
Result<ImportedCloud> read_cloud_blob(std::span<const std::byte> bytes);

}  // namespace pointwright
