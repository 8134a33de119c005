#pragma once
// The golden files of the protocol: frames, streams and their decoded values (protocol/vectors), and the
// documents that the server sends (protocol/examples). A tool writes them, a test compares them with what the
// code gives today.

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/frames/frame.h"

namespace pointwright::protocol::golden {

struct File {
  std::string path;  ///< below protocol/
  std::string content;
};

/// Columns of a small cloud whose every number is exact, so that each machine makes the same bytes.
struct Columns {
  explicit Columns(std::uint32_t count);
  Points position;
  Points normal;
  std::vector<float> t, detail, stretch;
  std::vector<Rgba> color;
  std::vector<std::uint8_t> marks;
  std::vector<std::uint32_t> ids;
  std::vector<std::uint16_t> radius;

  [[nodiscard]] FrameColumns view() const;
};

/// protocol/vectors: *.frame, stream.bin, vectors.json, malformed.json
std::vector<File> vector_files();
/// protocol/examples: the documents that the server sends
std::vector<File> document_files();

}  // namespace pointwright::protocol::golden
