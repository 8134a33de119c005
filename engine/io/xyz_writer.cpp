#include <algorithm>
#include <type_traits>

#include "engine/io/xyz.h"

namespace pointwright {
namespace {

std::string heading(const ExportView& view) {
  const Cloud& cloud = view.cloud();
  std::string text = "# x y z";
  if (cloud.has_normals()) text += " nx ny nz";
  if (cloud.has_colors()) text += cloud.color_has_alpha ? " red green blue alpha" : " red green blue";
  if (!cloud.texcoord.empty()) text += " " + view.texcoord_names()[0] + " " + view.texcoord_names()[1];
  for (std::string name : view.scalar_names()) {
    std::replace_if(
        name.begin(), name.end(), [](char c) { return c == ',' || c == ';' || c == '#'; }, '_');
    text += " " + name;
  }
  return text == "# x y z" ? "" : text + "\n";
}

}  // namespace

std::vector<std::byte> write_xyz(const ExportView& view) {
  const Cloud& cloud = view.cloud();
  std::string text = heading(view);
  constexpr std::size_t kUsualRow = 48;
  text.reserve(text.size() + view.size() * kUsualRow);
  const auto put = [&](auto value) {
    if constexpr (std::is_floating_point_v<decltype(value)>) {
      append_number(text, value);
    } else {
      append_number(text, static_cast<std::int64_t>(value));
    }
    text += ' ';
  };
  for (std::size_t row = 0; row < view.size(); ++row) {
    const std::uint32_t i = view.sample(row);
    for (const double coordinate : view.position(i)) {
      if (view.needs_double()) {
        put(coordinate);
      } else {
        put(static_cast<float>(coordinate));
      }
    }
    if (cloud.has_normals()) {
      for (const float* column : {cloud.normal.x(), cloud.normal.y(), cloud.normal.z()}) put(column[i]);
    }
    if (cloud.has_colors()) {
      for (std::size_t channel = 0; channel < (cloud.color_has_alpha ? 4U : 3U); ++channel)
        put(cloud.color[i][channel]);
    }
    if (!cloud.texcoord.empty()) {
      for (const float coordinate : cloud.texcoord[i]) put(coordinate);
    }
    for (const ScalarAttribute& scalar : cloud.scalars) {
      std::visit([&](const auto& values) { put(values[i]); }, scalar.values);
    }
    text.back() = '\n';
  }
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

}  // namespace pointwright
