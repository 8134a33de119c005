#include "engine/io/draco_gate.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

namespace pointwright {
namespace {

constexpr std::uint64_t kMostSamplesPerByte = 1000;
constexpr std::uint64_t kMostDecodedPerByte = 65536;
constexpr std::uint64_t kMostAttributes = 64;
constexpr std::uint64_t kMostComponents = 16;
constexpr std::uint64_t kMostMetadataNodes = 4096;
constexpr std::size_t kDeepestMetadata = 32;
constexpr std::uint16_t kMetadataFlag = 0x8000;

class Gate {
 public:
  Gate(std::span<const std::byte> bytes, std::uint64_t max_samples)
      : bytes_(bytes), max_samples_(max_samples) {}

  Result<DracoClaim> run() {
    if (auto done = read_header(); !done) return done.error();
    if (has_metadata_) {
      if (auto done = skip_geometry_metadata(); !done) return done.error();
    }
    if (auto done = claim_.is_mesh ? read_mesh_counts() : read_cloud_counts(); !done) return done.error();
    if (auto done = check_counts(); !done) return done.error();
    if (!claim_.is_mesh) {
      if (auto done = read_descriptors(); !done) return done.error();
    }
    return claim_;
  }

 private:
  Error malformed(const std::string& what) const {
    return Error{.code = ErrorCode::kMalformedData,
                 .message = "byte " + std::to_string(at_) + " of the Draco file: " + what,
                 .field = {}};
  }
  Error cut() const { return malformed("the file ends inside its header"); }
  static Error unsupported(std::string what) {
    return Error{.code = ErrorCode::kUnsupportedFormat, .message = std::move(what), .field = {}};
  }

  bool read_byte(std::uint64_t& value) {
    if (at_ == bytes_.size()) return false;
    value = std::to_integer<std::uint64_t>(bytes_[at_++]);
    return true;
  }
  bool read_fixed(std::size_t size, std::uint64_t& value) {
    value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      std::uint64_t byte = 0;
      if (!read_byte(byte)) return false;
      value |= byte << (8 * i);
    }
    return true;
  }
  // Seven bits a byte, the lowest first; at most 32 bits.
  bool read_varint(std::uint64_t& value) {
    value = 0;
    for (unsigned shift = 0; shift < 35; shift += 7) {
      std::uint64_t byte = 0;
      if (!read_byte(byte)) return false;
      value |= (byte & 0x7f) << shift;
      if ((byte & 0x80) == 0) return value <= 0xffffffffULL;
    }
    return false;
  }
  bool skip(std::uint64_t size) {
    if (size > bytes_.size() - at_) return false;
    at_ += static_cast<std::size_t>(size);
    return true;
  }
  bool skip_name() {
    std::uint64_t length = 0;
    return read_byte(length) && skip(length);
  }

  Result<void> read_header() {
    constexpr std::string_view kDracoMagic = "DRACO";
    std::array<std::uint64_t, 4> head{};  // major, minor, kind, method
    std::uint64_t flags = 0;
    for (const char c : kDracoMagic) {
      std::uint64_t byte = 0;
      if (!read_byte(byte) || byte != static_cast<unsigned char>(c))
        return malformed("it does not start with 'DRACO'");
    }
    for (auto& value : head) {
      if (!read_byte(value)) return cut();
    }
    if (!read_fixed(2, flags)) return cut();
    const auto [major, minor, kind, method] = head;
    if (kind > 1 || method > 1) return malformed("unknown kind of geometry or method");
    claim_.is_mesh = kind == 1;
    const bool current = major == 2 && (minor == 2 || (minor == 3 && !claim_.is_mesh));
    if (!current) {
      return unsupported("Draco bitstream " + std::to_string(major) + "." + std::to_string(minor) +
                         " is not read: clouds of 2.2 and 2.3 and meshes of 2.2 are. Encode it anew with "
                         "Draco 1.3 or later");
    }
    if ((flags & ~std::uint64_t{kMetadataFlag}) != 0) return unsupported("the Draco file uses unknown flags");
    has_metadata_ = (flags & kMetadataFlag) != 0;
    constexpr std::array<std::array<const char*, 2>, 2> kEncodings{
        {{"sequential", "kd_tree"}, {"mesh_sequential", "mesh_edgebreaker"}}};
    claim_.encoding = kEncodings[kind][method];
    return {};
  }

  Result<void> skip_geometry_metadata() {
    std::uint64_t attributes = 0;
    if (!read_varint(attributes)) return cut();
    for (std::uint64_t i = 0; i < attributes; ++i) {
      std::uint64_t unique_id = 0;
      if (!read_varint(unique_id)) return cut();
      if (auto done = skip_metadata(); !done) return done;
    }
    return skip_metadata();
  }

  // A tree of entries, walked without recursion: how many children of each open node are still to come.
  Result<void> skip_metadata() {
    std::vector<std::uint64_t> open{1};
    bool at_root = true;
    while (!open.empty()) {
      if (open.back() == 0) {
        open.pop_back();
        continue;
      }
      --open.back();
      if (++metadata_nodes_ > kMostMetadataNodes) return malformed("more than 4096 metadata nodes");
      if (!at_root && !skip_name()) return cut();
      at_root = false;
      std::uint64_t entries = 0;
      if (!read_varint(entries)) return cut();
      for (std::uint64_t i = 0; i < entries; ++i) {
        std::uint64_t size = 0;
        if (!skip_name() || !read_varint(size) || !skip(size)) return cut();
      }
      std::uint64_t children = 0;
      if (!read_varint(children)) return cut();
      if (open.size() == kDeepestMetadata) return malformed("metadata nested deeper than 32");
      open.push_back(children);
    }
    return {};
  }

  Result<void> read_cloud_counts() {
    if (!read_fixed(4, claim_.points)) return cut();
    if (claim_.points > 0x7fffffffULL) return malformed("a negative number of points");
    return {};
  }

  Result<void> read_mesh_counts() {
    std::uint64_t first = 0;
    std::uint64_t second = 0;
    if (claim_.encoding == "mesh_edgebreaker") {
      std::uint64_t traversal = 0;
      if (!read_byte(traversal) || !read_varint(first) || !read_varint(second)) return cut();
      if (traversal > 2) return malformed("unknown traversal");
      claim_.points = first;
      claim_.faces = second;
    } else {
      if (!read_varint(first) || !read_varint(second)) return cut();
      claim_.faces = first;
      claim_.points = second;
    }
    return {};
  }

  Result<void> check_counts() const {
    if (claim_.points == 0) {
      return Error{.code = ErrorCode::kEmptyCloud, .message = "the Draco file has no points", .field = {}};
    }
    if (claim_.points > max_samples_) {
      return Error{.code = ErrorCode::kTooLarge,
                   .message = "the file claims " + std::to_string(claim_.points) + " samples; at most " +
                              std::to_string(max_samples_) + " are taken",
                   .field = {},
                   .limit = static_cast<double>(max_samples_),
                   .actual = static_cast<double>(claim_.points)};
    }
    const std::uint64_t most = kMostSamplesPerByte * bytes_.size();
    const std::uint64_t claimed = std::max(claim_.points, claim_.faces);
    if (claimed > most) {
      return Error{.code = ErrorCode::kTooLarge,
                   .message = "the file claims " + std::to_string(claimed) + " samples or faces in " +
                              std::to_string(bytes_.size()) + " bytes; at most 1000 a byte are believed",
                   .field = {},
                   .limit = static_cast<double>(most),
                   .actual = static_cast<double>(claimed)};
    }
    return {};
  }

  Result<void> read_descriptors() {
    constexpr std::array<std::uint64_t, 12> kTypeSizes{0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8, 1};
    std::uint64_t groups = 0;
    std::uint64_t attributes = 0;
    if (!read_byte(groups)) return cut();
    if (groups != 1)
      return malformed("a point cloud has one group of attributes, not " + std::to_string(groups));
    if (!read_varint(attributes)) return cut();
    if (attributes == 0 || attributes > kMostAttributes) {
      return malformed("1 to 64 attributes are read, not " + std::to_string(attributes));
    }
    for (std::uint64_t i = 0; i < attributes; ++i) {
      std::uint64_t kind = 0, type = 0, components = 0, normalized = 0, unique_id = 0;
      if (!read_byte(kind) || !read_byte(type) || !read_byte(components) || !read_byte(normalized) ||
          !read_varint(unique_id)) {
        return cut();
      }
      if (kind > 4 || type == 0 || type >= kTypeSizes.size())
        return malformed("an attribute of unknown kind or type");
      if (components == 0 || components > kMostComponents) {
        return malformed("an attribute has 1 to 16 components, not " + std::to_string(components));
      }
      claim_.sample_bytes += kTypeSizes[type] * components;
    }
    if (claim_.points * claim_.sample_bytes > kMostDecodedPerByte * bytes_.size()) {
      return Error{.code = ErrorCode::kTooLarge,
                   .message = "the file claims to unpack to more than 65536 times its size",
                   .field = {},
                   .limit = static_cast<double>(kMostDecodedPerByte * bytes_.size()),
                   .actual = static_cast<double>(claim_.points * claim_.sample_bytes)};
    }
    return {};
  }

  std::span<const std::byte> bytes_;
  std::uint64_t max_samples_;
  std::size_t at_ = 0;
  bool has_metadata_ = false;
  std::uint64_t metadata_nodes_ = 0;
  DracoClaim claim_;
};

}  // namespace

Result<DracoClaim> draco_gate(std::span<const std::byte> bytes, std::uint64_t max_samples) {
  return Gate(bytes, max_samples).run();
}

}  // namespace pointwright
