#include "engine/io/draco_tiles.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "engine/io/draco_codec.h"
#include "engine/io/text.h"

namespace pointwright {
namespace {

constexpr std::string_view kIndexHead = "file,sample_count,min_x,min_y,min_z,max_x,max_y,max_z";
constexpr std::size_t kMostTiles = std::size_t{1} << 18U;
constexpr std::uint64_t kMostIndexBytes = kMostTiles * 128;
/// Of a tile's file: more than any attributes that a sample has, and what a few samples take at least.
constexpr std::uint64_t kMostBytesOfSample = 1024;
constexpr std::uint64_t kLeastTileBytes = std::uint64_t{1} << 20U;
constexpr std::uint64_t kMostTileBytes = std::uint64_t{1} << 30U;

Error malformed(std::string message) {
  return Error{.code = ErrorCode::kMalformedData,
               .message = std::move(message),
               .field = std::string(kDracoTilesIndex)};
}

/// A line's fields between commas. Names have none.
std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t comma = line.find(',');
    fields.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

bool parse_tile(std::string_view line, DracoTile& tile) {
  const std::vector<std::string_view> fields = fields_of(line);
  if (fields.size() != 8 || fields[0].empty()) return false;
  tile.file = std::string(fields[0]);
  if (!parse_integer(fields[1], tile.sample_count)) return false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<Eigen::Index>(axis);
    if (!parse_number(fields[2 + axis], tile.min[at]) || !parse_number(fields[5 + axis], tile.max[at]))
      return false;
  }
  return tile.sample_count > 0 && (tile.min.array() <= tile.max.array()).all();
}

/// Positions that float32 says as well become float32.
void narrow_positions(std::vector<ScalarAttribute>& columns) {
  const auto says = [](double x) { return static_cast<double>(static_cast<float>(x)) == x; };
  const auto is_narrow = [&](std::size_t k) {
    return std::ranges::all_of(std::get<std::vector<double>>(columns[k].values), says);
  };
  if (!is_narrow(0) || !is_narrow(1) || !is_narrow(2)) return;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto wide = std::get<std::vector<double>>(std::move(columns[k].values));
    columns[k].values = std::vector<float>(wide.begin(), wide.end());
  }
}

}  // namespace

std::string draco_tile_name(std::size_t k) {
  std::string number = std::to_string(k);
  number.insert(0, 6 - std::min<std::size_t>(6, number.size()), '0');
  return "tiles/" + number + ".drc";
}

std::string draco_tiles_index(std::span<const DracoTile> tiles) {
  std::string text = std::string(kIndexHead) + "\n";
  for (const DracoTile& tile : tiles) {
    text += tile.file + "," + std::to_string(tile.sample_count);
    for (const Vec3d& corner : {tile.min, tile.max})
      for (const double x : corner) {
        text += ',';
        append_number(text, x);
      }
    text += '\n';
  }
  return text;
}

Result<std::vector<DracoTile>> parse_draco_tiles_index(std::string_view text, std::uint64_t max_samples) {
  LineReader lines(text);
  TextLine line;
  if (!lines.next(line) || line.text != kIndexHead)
    return malformed("the index does not begin with the line " + std::string(kIndexHead));
  std::vector<DracoTile> tiles;
  std::set<std::string> names;
  std::uint64_t samples = 0;
  while (lines.next(line)) {
    if (line.text.empty()) continue;
    DracoTile tile;
    if (!parse_tile(line.text, tile))
      return malformed("line " + std::to_string(line.number) + ": " + quoted(line.text) +
                       " is no tile with samples and bounds");
    if (tile.sample_count > max_samples - samples)
      return Error{.code = ErrorCode::kTooLarge,
                   .message = "the tiles claim more than the " + std::to_string(max_samples) +
                              " samples that are taken",
                   .field = std::string(kDracoTilesIndex),
                   .limit = static_cast<double>(max_samples)};
    samples += tile.sample_count;
    if (tiles.size() == kMostTiles)
      return Error{.code = ErrorCode::kTooLarge,
                   .message = "the index names more than " + std::to_string(kMostTiles) + " tiles",
                   .field = std::string(kDracoTilesIndex),
                   .limit = static_cast<double>(kMostTiles)};
    if (!names.insert(tile.file).second)
      return malformed("line " + std::to_string(line.number) + " names " + quoted(tile.file) + " again");
    tiles.push_back(std::move(tile));
  }
  if (tiles.empty())
    return Error{.code = ErrorCode::kEmptyCloud,
                 .message = "the index names no tile",
                 .field = std::string(kDracoTilesIndex)};
  return tiles;
}

bool looks_like_draco_tiles(std::span<const std::byte> bytes) {
  constexpr std::string_view kMagic("PK\x03\x04", 4);
  constexpr std::size_t kNameLengthAt = 26;
  constexpr std::size_t kNameAt = 30;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return text.starts_with(kMagic) && text.size() > kNameAt + kDracoTilesIndex.size() &&
         text[kNameLengthAt] == static_cast<char>(kDracoTilesIndex.size()) && text[kNameLengthAt + 1] == 0 &&
         text.substr(kNameAt).starts_with(kDracoTilesIndex);
}

DracoTilesReader::DracoTilesReader(ZipReader zip, std::vector<DracoTile> tiles)
    : zip_(std::move(zip)), tiles_(std::move(tiles)), is_read_(tiles_.size(), false) {
  for (std::size_t k = 0; k < tiles_.size(); ++k) places_.emplace(tiles_[k].file, k);
}

Result<DracoTilesReader> DracoTilesReader::open(std::span<const std::byte> bytes, std::uint64_t max_samples) {
  auto zip = ZipReader::open(bytes);
  if (!zip) return zip.error();
  while (true) {
    const auto name = zip.value().next();
    if (!name) return name.error();
    if (!name.value())
      return malformed(
          "the archive has no index.csv, as Draco tiles have: another file in it is sent by itself");
    if (*name.value() != kDracoTilesIndex) continue;
    const auto content = zip.value().content(kMostIndexBytes);
    if (!content) return content.error();
    auto tiles = parse_draco_tiles_index(text_of(content.value()), max_samples);
    if (!tiles) return tiles.error();
    // From the beginning: the index need not be the first.
    auto again = ZipReader::open(bytes);
    if (!again) return again.error();
    return DracoTilesReader(std::move(again).value(), std::move(tiles).value());
  }
}

std::uint64_t DracoTilesReader::sample_count() const {
  std::uint64_t samples = 0;
  for (const DracoTile& tile : tiles_) samples += tile.sample_count;
  return samples;
}

Result<std::optional<DracoTilesReader::Piece>> DracoTilesReader::next() {
  while (true) {
    const auto name = zip_.next();
    if (!name) return name.error();
    if (!name.value()) break;
    const auto place = places_.find(*name.value());
    if (place == places_.end()) continue;
    const std::size_t tile = place->second;
    if (is_read_[tile]) return malformed("the archive has " + quoted(*name.value()) + " twice");
    const std::uint64_t samples = std::min(tiles_[tile].sample_count, kMostTileBytes);
    auto content = zip_.content(std::min(kMostTileBytes, kLeastTileBytes + kMostBytesOfSample * samples));
    if (!content) return content.error();
    is_read_[tile] = true;
    return std::optional(Piece{.tile = tile, .bytes = std::move(content).value()});
  }
  const auto missing = std::ranges::find(is_read_, false);
  if (missing == is_read_.end()) return std::optional<Piece>();
  return malformed("the archive has no " +
                   quoted(tiles_[static_cast<std::size_t>(missing - is_read_.begin())].file));
}

Cloud part_of(const Cloud& cloud, std::uint32_t begin, std::uint32_t end) {
  std::vector<std::uint32_t> order(end - begin);
  for (std::uint32_t i = begin; i < end; ++i) order[i - begin] = i;
  return permuted(cloud, order);
}

DracoTile draco_tile_of(const Cloud& cloud, std::string file) {
  DracoTile tile{.file = std::move(file), .sample_count = cloud.size()};
  tile.min = tile.max = model_position(cloud, 0);
  for (std::size_t i = 1; i < cloud.size(); ++i) {
    const Vec3d p = model_position(cloud, i);
    tile.min = tile.min.cwiseMin(p);
    tile.max = tile.max.cwiseMax(p);
  }
  return tile;
}

Result<void> write_draco_tiles_archive(
    std::span<const DracoTile> tiles, std::span<const std::uint64_t> bytes,
    const std::function<Result<std::vector<std::byte>>(std::size_t)>& content, const ByteSink& sink) {
  const std::string index = draco_tiles_index(tiles);
  std::vector<ZipEntry> entries;
  entries.reserve(tiles.size() + 1);
  entries.push_back({.name = std::string(kDracoTilesIndex), .bytes = index.size(), .content = [&index] {
                       const auto text = std::as_bytes(std::span(index.data(), index.size()));
                       return Result(std::vector<std::byte>(text.begin(), text.end()));
                     }});
  for (std::size_t k = 0; k < tiles.size(); ++k)
    entries.push_back(
        {.name = tiles[k].file, .bytes = bytes[k], .content = [&content, k] { return content(k); }});
  return write_zip(entries, sink);
}

Error in_tile(Error error, const DracoTile& tile) {
  error.message = quoted(tile.file) + ": " + error.message;
  return error;
}

Result<std::vector<ScalarAttribute>> tile_columns(const Cloud& cloud, const DracoTile& tile) {
  if (cloud.size() != tile.sample_count)
    return malformed(quoted(tile.file) + " has " + std::to_string(cloud.size()) + " samples, not " +
                     std::to_string(tile.sample_count));
  return columns_of(ExportView(cloud, true));
}

Result<std::vector<std::size_t>> match_columns(std::span<const ScalarAttribute> wanted,
                                               std::span<const ScalarAttribute> columns,
                                               const DracoTile& tile) {
  const auto other = [&](const std::string& name) {
    return malformed("all tiles hold the same attributes, but " + quoted(tile.file) +
                     " differs from the first one in " + quoted(name));
  };
  std::map<std::string_view, std::size_t> places;
  for (std::size_t k = 0; k < columns.size(); ++k) places.emplace(columns[k].name, k);
  std::vector<std::size_t> found;
  found.reserve(wanted.size());
  for (const ScalarAttribute& column : wanted) {
    const auto place = places.find(column.name);
    if (place == places.end() || type_of(columns[place->second]) != type_of(column))
      return other(column.name);
    found.push_back(place->second);
    places.erase(place);
  }
  if (!places.empty()) return other(std::string(places.begin()->first));
  return found;
}

Result<ImportedCloud> read_draco_tiles(std::span<const std::byte> bytes, const ImportParams& params) {
  auto reader = DracoTilesReader::open(
      bytes, std::min<std::uint64_t>(params.max_samples, std::numeric_limits<std::uint32_t>::max() - 1U));
  if (!reader) return reader.error();
  const std::vector<DracoTile>& tiles = reader.value().tiles();
  std::vector<std::vector<ScalarAttribute>> parts(tiles.size());
  ImportReport report;
  report.format = CloudFormat::kDracoTiles;
  bool is_double = false;
  while (true) {
    const auto piece = reader.value().next();
    if (!piece) return piece.error();
    if (!piece.value()) break;
    const std::size_t k = piece.value()->tile;
    const auto decoded = read_draco(piece.value()->bytes, {.max_samples = tiles[k].sample_count});
    if (!decoded) return in_tile(decoded.error(), tiles[k]);
    is_double = is_double || decoded.value().cloud.position_is_double;
    report.encoding = decoded.value().report.encoding;
    report.from_mesh = report.from_mesh || decoded.value().report.from_mesh;
    auto columns = tile_columns(decoded.value().cloud, tiles[k]);
    if (!columns) return columns.error();
    parts[k] = std::move(columns).value();
  }
  std::vector<ScalarAttribute> all = std::move(parts.front());
  for (std::size_t k = 1; k < parts.size(); ++k) {
    const auto places = match_columns(all, parts[k], tiles[k]);
    if (!places) return places.error();
    for (std::size_t c = 0; c < all.size(); ++c)
      std::visit(
          [&](auto& values) {
            const auto& more = std::get<std::decay_t<decltype(values)>>(parts[k][places.value()[c]].values);
            values.insert(values.end(), more.begin(), more.end());
          },
          all[c].values);
    parts[k] = {};
  }
  report.declared_count = all.front().size();
  if (!is_double) narrow_positions(all);
  return assemble_cloud(std::move(all), std::move(report));
}

Result<std::vector<std::byte>> write_draco_tiles(const Cloud& cloud, int position_bits) {
  const auto count = static_cast<std::uint32_t>(cloud.size());
  std::vector<DracoTile> tiles;
  std::vector<std::vector<std::byte>> files;
  std::vector<std::uint64_t> sizes;
  for (std::uint32_t begin = 0; begin < count;) {
    const std::uint32_t end = count - begin > kMostTileSamples ? begin + kMostTileSamples : count;
    const Cloud part = part_of(cloud, begin, end);
    auto file = write_draco(ExportView(part, false), position_bits);
    if (!file) return file.error();
    tiles.push_back(draco_tile_of(part, draco_tile_name(tiles.size())));
    sizes.push_back(file.value().size());
    files.push_back(std::move(file).value());
    begin = end;
  }
  std::vector<std::byte> archive;
  const auto written = write_draco_tiles_archive(
      tiles, sizes, [&](std::size_t k) { return Result(std::move(files[k])); },
      [&](std::span<const std::byte> bytes) {
        archive.insert(archive.end(), bytes.begin(), bytes.end());
        return true;
      });
  if (!written) return written.error();
  return archive;
}

}  // namespace pointwright
