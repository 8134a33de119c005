#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>

#include "protocol/frames/frame.h"
#include "protocol/frames/stream_record.h"
#include "protocol/json/access.h"
#include "protocol/json/parse.h"
#include "protocol/json/recipe.h"
#include "protocol/json/requests.h"
#include "tests/fuzz/targets.h"

namespace pointwright::fuzz {
namespace {

using namespace protocol;

constexpr FrameLimits kFrameLimits{.max_samples = 1'000'000};

void promise(bool kept, const char* what) {
  if (!kept) throw std::logic_error(std::string("broken promise: ") + what);
}

template <typename T>
void take(const Json& document, Parsed<T> (*parse)(const Json&)) {
  const auto parsed = parse(document);
  if (!parsed.ok()) promise(!parsed.errors().summary().empty(), "a refusal says why");
}

}  // namespace

void try_frame(std::span<const std::byte> bytes) {
  const auto frame = decode_frame(bytes, kFrameLimits);
  if (!frame.ok()) {
    promise(!frame.error().message.empty(), "an error says something");
    return;
  }
  const FrameHeader& header = frame.value().header;
  promise(frame.value().blocks.size() == header.present_blocks, "every block that was announced is there");
  for (const DecodedBlock& block : frame.value().blocks) {
    promise(block.number < header.block_count && block.count <= header.block_size, "blocks are in range");
    for (const Vec3d& position : decode_positions(header, block))
      promise(position.allFinite(), "positions are finite");
    for (const Vec3f& normal : decode_normals(block))
      promise(std::abs(normal.norm() - 1.0F) < 1e-3F, "normals are unit vectors");
  }
}

void try_stream(std::span<const std::byte> bytes) {
  // Whole, and in chunks of 7 bytes: the same records and the same end.
  const auto read = [&](std::size_t chunk_bytes) {
    StreamRecordParser parser(1U << 16);
    std::vector<StreamRecord> records;
    for (std::size_t at = 0; at < bytes.size(); at += chunk_bytes) {
      parser.push(bytes.subspan(at, std::min(chunk_bytes, bytes.size() - at)));
      for (;;) {
        auto record = parser.next();
        if (!record.ok()) return std::pair(std::move(records), false);
        if (!record.value()) break;
        records.push_back(*std::move(record).value());
      }
    }
    return std::pair(std::move(records), parser.at_record_end());
  };
  const auto [whole, whole_ends] = read(std::max<std::size_t>(1, bytes.size()));
  const auto [pieces, pieces_end] = read(7);
  promise(whole_ends == pieces_end && whole.size() == pieces.size(), "chunks do not matter");
  for (std::size_t i = 0; i < whole.size(); ++i)
    promise(whole[i].type == pieces[i].type && whole[i].payload == pieces[i].payload, "records stay whole");
}

void try_json(std::span<const std::byte> bytes) {
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const auto document = parse_json(text, {.max_bytes = 1U << 20, .max_depth = 32, .max_values = 10'000});
  if (!document.ok()) {
    promise(!document.errors().summary().empty(), "a refusal says why");
    return;
  }
  promise(Json::parse(document.value().dump()) == document.value(),
          "what was parsed can be printed and read");
  take(document.value(), parse_paint_operation);
  take(document.value(), parse_painting);
  take(document.value(), parse_edit);
  take(document.value(), parse_preview);
  take(document.value(), parse_create_session);
  take(document.value(), parse_head);
  take(document.value(), parse_import_cloud);
  take(document.value(), parse_session_change);
  take(document.value(), parse_recipe_request);
  take(document.value(), parse_token_request);
  take(document.value(), parse_share_request);
  take(document.value(), parse_token_file);
}

}  // namespace pointwright::fuzz
