#include <cmath>
#include <numeric>

#include "protocol/frames/stream_record.h"
#include "protocol/json/documents.h"
#include "tests/protocol/golden.h"

namespace pointwright::protocol::golden {
namespace {

constexpr std::uint32_t kSamples = 150;
constexpr std::uint32_t kBlockSize = 16;

template <typename Bytes>
std::string to_string(const Bytes& bytes) {
  std::string text(bytes.size(), '\0');
  if (!bytes.empty()) std::memcpy(text.data(), bytes.data(), bytes.size());
  return text;
}

template <typename T>
JsonDocument array_of(const std::vector<T>& values) {
  JsonDocument array = JsonDocument::array();
  for (const T& value : values) array.push_back(value);
  return array;
}

template <typename T, std::size_t kWidth>
JsonDocument flat_array_of(const std::vector<std::array<T, kWidth>>& values) {
  JsonDocument array = JsonDocument::array();
  for (const auto& value : values) {
    for (const T entry : value) array.push_back(entry);
  }
  return array;
}

JsonDocument header_document(const FrameHeader& header) {
  const Vec3d center = header.bounds.center.cast<double>();
  return JsonDocument{{"kind", header.kind == FrameKind::kKey ? "key" : "delta"},
                      {"level", header.level},
                      {"attributes", header.attributes},
                      {"revision", header.revision},
                      {"sequence", header.sequence},
                      {"sampleCount", header.sample_count},
                      {"blockSize", header.block_size},
                      {"blockCount", header.block_count},
                      {"presentBlocks", header.present_blocks},
                      {"origin", to_json(header.origin)},
                      {"detailRange", static_cast<double>(header.detail_range)},
                      {"stretchRange", static_cast<double>(header.stretch_range)},
                      {"bounds", JsonDocument{{"center", to_json(center)},
                                              {"radius", static_cast<double>(header.bounds.radius)}}}};
}

JsonDocument block_document(const FrameHeader& header, const DecodedBlock& block) {
  JsonDocument positions = JsonDocument::array();
  for (const Vec3d& position : decode_positions(header, block)) {
    for (const double coordinate : position) positions.push_back(coordinate);
  }
  JsonDocument normals = JsonDocument::array();
  for (const Vec3f& normal : decode_normals(block)) {
    for (const float coordinate : normal) normals.push_back(static_cast<double>(coordinate));
  }
  JsonDocument detail_stretch = JsonDocument::array();
  for (std::size_t i = 0; i < block.detail.size(); ++i) {
    detail_stretch.push_back(static_cast<std::uint16_t>(block.detail[i]));
    detail_stretch.push_back(block.stretch[i]);
  }
  return JsonDocument{{"number", block.number},
                      {"count", block.count},
                      {"minimum", to_json(Vec3d(block.minimum.cast<double>()))},
                      {"extent", to_json(Vec3d(block.extent.cast<double>()))},
                      {"positionT", flat_array_of(block.position_t)},
                      {"normal", flat_array_of(block.normal)},
                      {"detailStretch", std::move(detail_stretch)},
                      {"color", flat_array_of(block.color)},
                      {"marks", array_of(block.marks)},
                      {"ids", array_of(block.ids)},
                      {"radius", array_of(block.radius)},
                      {"positions", std::move(positions)},
                      {"normals", std::move(normals)}};
}

JsonDocument frame_document(const std::string& file, const FrameBytes& bytes) {
  const DecodedFrame frame = decode_frame(bytes).value();
  JsonDocument blocks = JsonDocument::array();
  for (const DecodedBlock& block : frame.blocks) blocks.push_back(block_document(frame.header, block));
  return JsonDocument{
      {"file", file}, {"header", header_document(frame.header)}, {"blocks", std::move(blocks)}};
}

FrameState state() {
  return {.level = 1,
          .revision = 7,
          .sequence = 4'294'967'297,  // beyond 32 bits
          .origin = Vec3d(652'000.25, -4'000'000.5, 12.125),
          .detail_range = 0.5F,
          .stretch_range = 4.0F};
}

FrameBytes full_key() {
  const Columns columns(kSamples);
  FrameBytes bytes;
  encode_key_frame(FrameLayout(kSamples, kBlockSize), columns.view(), state(), kAllFrameAttributes, bytes);
  return bytes;
}

FrameBytes delta() {
  const Columns before(kSamples);
  Columns after(kSamples);
  for (const std::uint32_t sample : {3U, 4U, 64U})
    after.position.set(sample, after.position[sample] + Vec3f(1, 2, 3));
  after.t[149] = 0.25F;
  const FrameLayout layout(kSamples, kBlockSize);
  const auto blocks = changed_blocks(layout, before.view(), after.view(), kFrameNormal | kFrameT);
  FrameBytes bytes;
  encode_delta_frame(layout, after.view(), state(), kFrameNormal | kFrameT, blocks, bytes);
  return bytes;
}

FrameBytes single() {
  const Columns columns(1);
  FrameBytes bytes;
  encode_key_frame(FrameLayout(1), columns.view(), {}, 0, bytes);
  return bytes;
}

FrameBytes empty() {
  const Columns columns(0);
  FrameBytes bytes;
  encode_key_frame(FrameLayout(0), columns.view(), {}, kFrameNormal | kFrameMarks, bytes);
  return bytes;
}

std::string stream() {
  std::vector<std::byte> bytes;
  const auto append = [&](std::uint32_t type, const std::string& payload) {
    append_stream_record(static_cast<StreamRecordType>(type), std::as_bytes(std::span(payload)), bytes);
  };
  append(2, to_text(progress_event({.phase = "normals", .fraction = 0.25})));
  append(1, to_string(delta()));
  append(77, "receivers skip this");
  append(2, "");
  append(2, to_text(end_event("the session was deleted")));
  return to_string(bytes);
}

std::string little_endian(double value, std::size_t bytes) {
  std::string text(bytes, '\0');
  if (bytes == 4) {
    const auto single_precision = static_cast<float>(value);
    std::memcpy(text.data(), &single_precision, 4);
  } else {
    std::memcpy(text.data(), &value, 8);
  }
  return text;
}

/// Frames that every decoder must refuse, as changes of good ones: bytes from an offset on, a cut, bytes at
/// the end.
JsonDocument malformed_frames() {
  JsonDocument list = JsonDocument::array();
  const auto add = [&](const char* name, const char* file) -> JsonDocument& {
    list.push_back(JsonDocument{{"name", name}, {"file", file}});
    return list.back();
  };
  const auto patch = [&](const char* name, const char* file, std::size_t offset, const std::string& bytes) {
    JsonDocument values = JsonDocument::array();
    for (const char byte : bytes) values.push_back(static_cast<unsigned char>(byte));
    JsonDocument& entry = add(name, file);
    entry["offset"] = offset;
    entry["bytes"] = std::move(values);
  };
  const double nan = std::nan("");
  const double infinity = std::numeric_limits<double>::infinity();
  add("no bytes", "key.frame")["cut"] = 0;
  add("shorter than the header", "key.frame")["cut"] = 95;
  add("only the header", "key.frame")["cut"] = 96;
  add("one byte missing", "key.frame")["cut"] = full_key().size() - 1;
  add("one byte more", "key.frame")["append"] = 1;
  add("one byte more than nothing", "empty.frame")["append"] = 1;
  patch("another magic", "key.frame", 0, "PWFS");
  patch("another version", "key.frame", 4, std::string("\x02\x00", 2));
  patch("another header size", "key.frame", 6, std::string("\x64\x00", 2));
  patch("a length that is not its own", "key.frame", 8, std::string("\x60\x00\x00\x00", 4));
  patch("unknown kind", "key.frame", 12, "\x02");
  patch("unknown attribute", "key.frame", 14, std::string("\xff\x00", 2));
  patch("attributes that make records longer", "single.frame", 14, std::string("\x01\x00", 2));
  patch("attributes that make records shorter", "key.frame", 14, std::string("\x7e\x00", 2));
  patch("a revision beyond 2^53", "key.frame", 16, "\xff\xff\xff\xff\xff\xff\xff\xff");
  patch("a sequence beyond 2^53", "key.frame", 24, std::string("\x00\x00\x00\x00\x00\x00\x20\x00", 8));
  patch("samples beyond the limit", "key.frame", 32, "\xff\xff\xff\xff");
  patch("samples that the blocks contradict", "key.frame", 32, std::string("\x95\x00\x00\x00", 4));
  patch("fewer samples than a delta's blocks", "delta.frame", 32, std::string("\x10\x00\x00\x00", 4));
  patch("block size 0", "key.frame", 36, std::string("\x00\x00\x00\x00", 4));
  patch("block size beyond 65536", "key.frame", 36, std::string("\x01\x00\x01\x00", 4));
  patch("block size below a count", "key.frame", 36, std::string("\x0f\x00\x00\x00", 4));
  patch("more blocks than present in a key", "key.frame", 40, std::string("\x0f\x00\x00\x00", 4));
  patch("more blocks than samples", "single.frame", 40, std::string("\x02\x00\x00\x00", 4));
  patch("fewer blocks present than all", "key.frame", 44, std::string("\x0d\x00\x00\x00", 4));
  patch("many blocks present in a delta", "delta.frame", 44, "\xff\xff\xff\xff");
  patch("an origin that is not a number", "key.frame", 48, little_endian(nan, 8));
  patch("an infinite origin", "key.frame", 64, little_endian(-infinity, 8));
  patch("a negative detail range", "key.frame", 72, little_endian(-1, 4));
  patch("an infinite stretch range", "key.frame", 76, little_endian(infinity, 4));
  patch("a centre that is not a number", "key.frame", 84, little_endian(nan, 4));
  patch("a negative radius", "key.frame", 92, little_endian(-1, 4));
  patch("a block number out of range", "key.frame", 96, std::string("\x0e\x00\x00\x00", 4));
  patch("a block that is there twice", "key.frame", 96, std::string("\x01\x00\x00\x00", 4));
  patch("blocks that do not ascend", "delta.frame", 96, std::string("\x0c\x00\x00\x00", 4));
  patch("an empty block", "key.frame", 100, std::string("\x00\x00\x00\x00", 4));
  patch("a count beyond the block", "key.frame", 100, std::string("\x11\x00\x00\x00", 4));
  patch("a minimum that is not a number", "key.frame", 104, little_endian(nan, 4));
  patch("a negative extent", "key.frame", 116, little_endian(-0.5, 4));
  patch("an infinite extent", "key.frame", 120, little_endian(infinity, 4));
  patch("a box that overflows", "single.frame", 104,
        little_endian(3e38, 4) + std::string(8, '\0') + little_endian(3e38, 4));
  patch("radii in a delta", "delta.frame", 14, std::string("\x43\x00", 2));
  // Block 0 has 3 samples: 3 marks and a byte of padding, 3 ids, 3 radii and two bytes of padding.
  const std::size_t end = 96 + block_record_bytes(3, kAllFrameAttributes);
  patch("padding of marks that is not zero", "key.frame", end - 8 - 12 - 1, "\x01");
  patch("padding of radii that is not zero", "key.frame", end - 1, "\x01");
  patch("a radius that is not finite", "key.frame", end - 8, "\x80\x7f");
  patch("a radius below zero", "key.frame", end - 8, "\x80\xbf");
  return list;
}

}  // namespace

Columns::Columns(std::uint32_t count)
    : position(count),
      normal(count),
      t(count),
      detail(count),
      stretch(count),
      color(count),
      marks(count),
      ids(count),
      radius(count) {
  std::uint32_t random = 12345;
  const auto next = [&random](std::uint32_t range) {
    random = random * 1664525U + 1013904223U;
    return (random >> 8) % range;
  };
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto along = static_cast<float>(i);
    position.set(i, {along / 8.0F, static_cast<float>(next(64)) / 64.0F - along / 4.0F,
                     static_cast<float>(next(1024)) / 16.0F});
    const auto component = [&] { return static_cast<float>(next(2001)) - 1000.0F; };
    const Vec3f direction(component(), component(), component());
    normal.set(i, i % 25 == 0 ? Vec3f(Vec3f::Unit(static_cast<int>(i / 25) % 3) * (i % 2 == 0 ? 1.0F : -1.0F))
                              : Vec3f(direction / direction.norm()));
    t[i] = static_cast<float>(next(257)) / 256.0F;
    detail[i] = (static_cast<float>(next(257)) - 128.0F) / 200.0F;  // beyond the range at both ends
    stretch[i] = static_cast<float>(next(65)) / 16.0F;
    color[i] = {static_cast<std::uint8_t>(next(256)), static_cast<std::uint8_t>(next(256)),
                static_cast<std::uint8_t>(next(256)), 255};
    marks[i] = static_cast<std::uint8_t>(next(4));
    ids[i] = count - 1 - i;
    radius[i] = to_bfloat16(static_cast<float>(i) / 64.0F);
  }
}

FrameColumns Columns::view() const {
  return {.position = &position,
          .normal = &normal,
          .t = t,
          .detail = detail,
          .stretch = stretch,
          .color = color,
          .marks = marks,
          .ids = ids,
          .radius = radius};
}

std::vector<File> vector_files() {
  const std::vector<std::pair<std::string, FrameBytes>> frames{{"key.frame", full_key()},
                                                               {"delta.frame", delta()},
                                                               {"single.frame", single()},
                                                               {"empty.frame", empty()}};
  std::vector<File> files;
  JsonDocument expected = JsonDocument::array();
  for (const auto& [name, bytes] : frames) {
    files.push_back({.path = "vectors/" + name, .content = to_string(bytes)});
    expected.push_back(frame_document(name, bytes));
  }
  files.push_back({.path = "vectors/stream.bin", .content = stream()});
  files.push_back({.path = "vectors/vectors.json", .content = expected.dump() + "\n"});
  files.push_back({.path = "vectors/malformed.json", .content = malformed_frames().dump() + "\n"});
  return files;
}

}  // namespace pointwright::protocol::golden
