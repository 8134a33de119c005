#pragma once
// Formats that clouds are written in: what their files are called, by name and by media type.

#include <array>
#include <string_view>

#include "engine/io/cloud_io.h"

namespace pointwright::server {

struct FileType {
  CloudFormat format;
  std::string_view media_type;
  std::string_view extension;
};
/// The first one is the usual one.
inline constexpr std::array kFileTypes = {
    FileType{CloudFormat::kPly, "application/x-ply", ".ply"},
    FileType{CloudFormat::kDraco, "model/x-draco", ".drc"},
    FileType{CloudFormat::kXyz, "text/plain; charset=utf-8", ".xyz"},
    FileType{CloudFormat::kLas, "application/vnd.las", ".las"},
    FileType{CloudFormat::kDracoTiles, "application/zip", ".zip"},
};

/// Pre: clouds are written in it.
constexpr const FileType& file_type(CloudFormat format) {
  for (const FileType& type : kFileTypes)
    if (type.format == format) return type;
  return kFileTypes.front();
}

}  // namespace pointwright::server
