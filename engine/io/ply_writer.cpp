#include <array>
#include <bit>
#include <type_traits>

#include "engine/io/ply.h"

namespace pointwright {
namespace {

std::string_view ply_type(ScalarType type) {
  constexpr std::array<std::string_view, 8> kNames{"char", "uchar", "short", "ushort",
                                                   "int",  "uint",  "float", "double"};
  return kNames[static_cast<std::size_t>(type)];
}

// The rows as bytes or as text; the same walk fills either.
class RowSink {
 public:
  RowSink(std::vector<std::byte>& out, bool ascii) : out_(out), ascii_(ascii) {}

  template <typename T>
  void put(T value) {
    if (!ascii_) {
      const auto raw = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
      out_.insert(out_.end(), raw.begin(), raw.end());
      return;
    }
    if (!row_.empty()) row_ += ' ';
    if constexpr (std::is_floating_point_v<T>) {
      append_number(row_, value);
    } else {
      append_number(row_, static_cast<std::int64_t>(value));
    }
  }
  void end_row() {
    if (!ascii_) return;
    row_ += '\n';
    const auto* begin = reinterpret_cast<const std::byte*>(row_.data());
    out_.insert(out_.end(), begin, begin + row_.size());
    row_.clear();
  }

 private:
  std::vector<std::byte>& out_;
  bool ascii_;
  std::string row_;
};

std::string header_text(PlyEncoding encoding, std::uint64_t count, std::span<const PlyProperty> properties) {
  std::string text = "ply\nformat ";
  text += encoding_name(encoding);
  text += " 1.0\ncomment Written by Pointwright\nelement vertex " + std::to_string(count) + "\n";
  for (const PlyProperty& property : properties)
    text += "property " + std::string(ply_type(property.type)) + " " + property.name + "\n";
  return text + "end_header\n";
}

std::string header_of(const ExportView& view, bool ascii) {
  const Cloud& cloud = view.cloud();
  std::vector<PlyProperty> properties;
  const auto property = [&](ScalarType type, const std::string& name) {
    properties.push_back({.name = name, .type = type});
  };
  for (const char* name : {"x", "y", "z"})
    property(view.needs_double() ? ScalarType::kDouble : ScalarType::kFloat, name);
  if (cloud.has_normals()) {
    for (const char* name : {"nx", "ny", "nz"}) property(ScalarType::kFloat, name);
  }
  if (cloud.has_colors()) {
    for (const char* name : {"red", "green", "blue"}) property(ScalarType::kUint8, name);
    if (cloud.color_has_alpha) property(ScalarType::kUint8, "alpha");
  }
  if (!cloud.texcoord.empty()) {
    for (const std::string& name : view.texcoord_names()) property(ScalarType::kFloat, name);
  }
  for (std::size_t s = 0; s < cloud.scalars.size(); ++s)
    property(type_of(cloud.scalars[s]), view.scalar_names()[s]);
  return header_text(ascii ? PlyEncoding::kAscii : PlyEncoding::kBinaryLittleEndian, view.size(), properties);
}

void put_row(const ExportView& view, std::uint32_t i, RowSink& sink) {
  const Cloud& cloud = view.cloud();
  for (const double coordinate : view.position(i)) {
    if (view.needs_double()) {
      sink.put(coordinate);
    } else {
      sink.put(static_cast<float>(coordinate));
    }
  }
  if (cloud.has_normals()) {
    for (const float* column : {cloud.normal.x(), cloud.normal.y(), cloud.normal.z()}) sink.put(column[i]);
  }
  if (cloud.has_colors()) {
    for (std::size_t channel = 0; channel < (cloud.color_has_alpha ? 4U : 3U); ++channel) {
      sink.put(cloud.color[i][channel]);
    }
  }
  if (!cloud.texcoord.empty()) {
    for (const float coordinate : cloud.texcoord[i]) sink.put(coordinate);
  }
  for (const ScalarAttribute& scalar : cloud.scalars) {
    std::visit([&](const auto& values) { sink.put(values[i]); }, scalar.values);
  }
}

std::size_t row_bytes(const ExportView& view, bool ascii) {
  const Cloud& cloud = view.cloud();
  std::size_t bytes = view.needs_double() ? 24 : 12;
  if (cloud.has_normals()) bytes += 12;
  if (cloud.has_colors()) bytes += cloud.color_has_alpha ? 4 : 3;
  if (!cloud.texcoord.empty()) bytes += 8;
  for (const ScalarAttribute& scalar : cloud.scalars) bytes += size_of(type_of(scalar));
  return ascii ? bytes * 3 : bytes;  // text: a guess, grown where it is short
}

}  // namespace

std::string ply_header_text(std::uint64_t count, std::span<const PlyProperty> properties) {
  return header_text(PlyEncoding::kBinaryLittleEndian, count, properties);
}

std::vector<std::byte> write_ply(const ExportView& view, bool ascii) {
  const std::string header = header_of(view, ascii);
  std::vector<std::byte> out;
  out.reserve(header.size() + view.size() * row_bytes(view, ascii));
  const auto* begin = reinterpret_cast<const std::byte*>(header.data());
  out.assign(begin, begin + header.size());
  RowSink sink(out, ascii);
  for (std::size_t row = 0; row < view.size(); ++row) {
    put_row(view, view.sample(row), sink);
    sink.end_row();
  }
  return out;
}

}  // namespace pointwright
