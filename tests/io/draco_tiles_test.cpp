// Clouds in tiles, and the archives that hold them.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/draco_codec.h"
#include "engine/io/draco_tiles.h"
#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

using Files = std::vector<std::pair<std::string, std::vector<std::byte>>>;

std::vector<std::byte> archive_of(const Files& files) {
  std::vector<ZipEntry> entries;
  for (const auto& file : files)
    entries.push_back({.name = file.first, .bytes = file.second.size(), .content = [&file] {
                         return Result(file.second);
                       }});
  std::vector<std::byte> archive;
  REQUIRE(write_zip(entries, [&](std::span<const std::byte> bytes) {
            archive.insert(archive.end(), bytes.begin(), bytes.end());
            return true;
          }).ok());
  return archive;
}

Files files_of(std::span<const std::byte> archive) {
  auto reader = ZipReader::open(archive);
  REQUIRE(reader.ok());
  Files files;
  while (true) {
    const auto name = reader.value().next();
    REQUIRE(name.ok());
    if (!name.value()) return files;
    auto content = reader.value().content(std::uint64_t{1} << 30U);
    REQUIRE(content.ok());
    files.emplace_back(*name.value(), std::move(content).value());
  }
}

/// The cloud cut in tiles of so many samples, as an archive of them.
std::vector<std::byte> in_tiles(const Cloud& cloud, std::uint32_t samples) {
  Files files{{std::string(kDracoTilesIndex), {}}};
  std::vector<DracoTile> tiles;
  for (std::uint32_t begin = 0; begin < cloud.size(); begin += samples) {
    std::vector<std::uint32_t> order;
    for (std::uint32_t i = begin; i < std::min<std::size_t>(cloud.size(), begin + samples); ++i)
      order.push_back(i);
    const Cloud part = permuted(cloud, order);
    const auto file = write_cloud(part, CloudFormat::kDraco, {.caller_order = false});
    REQUIRE(file.ok());
    tiles.push_back({.file = draco_tile_name(tiles.size()), .sample_count = part.size()});
    files.emplace_back(tiles.back().file, file.value());
  }
  files.front().second = bytes_of(draco_tiles_index(tiles));
  return archive_of(files);
}

TEST_CASE("every attribute comes back from Draco tiles to the bit, wherever the cloud stands") {
  for (const Place place : {Place::kNearZero, Place::kFarFloat, Place::kFarDouble, Place::kNearDouble}) {
    CAPTURE(static_cast<int>(place));
    // Extreme values repeat with every seventh sample: each tile has all of them.
    const Cloud cloud = cloud_with_everything(300, place).cloud;
    for (const std::uint32_t samples : {1000U, 300U, 100U, 77U}) {
      CAPTURE(samples);
      const auto bytes = in_tiles(cloud, samples);
      CHECK(detect_format(bytes).value() == CloudFormat::kDracoTiles);
      const auto read = read_cloud(bytes, CloudFormat::kDracoTiles, {});
      REQUIRE_MESSAGE(read.ok(), why(read));
      Cloud again = read.value().cloud;
      again.id = cloud.id;
      CHECK(difference(again, cloud) == "");
      CHECK(read.value().report.declared_count == 300);
    }
    Cloud whole = through(cloud, CloudFormat::kDracoTiles).cloud;
    whole.id = cloud.id;
    CHECK(difference(whole, cloud) == "");
  }
}

TEST_CASE("large clouds are cut into tiles, the index says where each lies, and any order of files is read") {
  const Cloud cloud = sphere(kMostTileSamples + 5).cloud;
  const auto bytes = write_cloud(cloud, CloudFormat::kDracoTiles, {.draco_position_bits = 14});
  REQUIRE(bytes.ok());
  CHECK(write_cloud(cloud, CloudFormat::kDracoTiles, {.draco_position_bits = 14}).value() == bytes.value());
  Files files = files_of(bytes.value());
  REQUIRE(files.size() == 3);
  CHECK(files[0].first == "index.csv");
  CHECK(files[1].first == "tiles/000000.drc");
  const auto tiles = parse_draco_tiles_index(text_of(files[0].second), cloud.size());
  REQUIRE(tiles.ok());
  REQUIRE(tiles.value().size() == 2);
  CHECK(tiles.value()[0].sample_count == kMostTileSamples);
  CHECK(tiles.value()[1].sample_count == 5);
  for (std::size_t k = 0; k < 2; ++k) {
    // A file of its own, within its bounds but for what 14 bits round.
    const auto tile = read_cloud(files[k + 1].second, CloudFormat::kDraco, {});
    REQUIRE(tile.ok());
    const ImportReport& report = tile.value().report;
    CHECK((report.bounds_min - tiles.value()[k].min).cwiseAbs().maxCoeff() < 2.0 / (1 << 14));
    CHECK((report.bounds_max - tiles.value()[k].max).cwiseAbs().maxCoeff() < 2.0 / (1 << 14));
  }
  const auto read = read_cloud(bytes.value(), CloudFormat::kDracoTiles, {});
  REQUIRE(read.ok());
  std::reverse(files.begin(), files.end());
  files.emplace_back("readme.txt", bytes_of("nothing of ours"));
  const auto turned = read_cloud(archive_of(files), CloudFormat::kDracoTiles, {});
  REQUIRE(turned.ok());
  CHECK(difference(turned.value().cloud, read.value().cloud) == "");
}

TEST_CASE("archives that are not whole or not of one kind are refused, and say which tile is to blame") {
  const Cloud cloud = cloud_with_everything(300, Place::kNearZero).cloud;
  const auto whole = in_tiles(cloud, 100);
  const auto refused = [&](const std::function<void(Files&)>& change) {
    Files files = files_of(whole);
    change(files);
    return error_of(archive_of(files), CloudFormat::kDracoTiles);
  };
  const auto index_with = [&](const std::string& from, const std::string& to) {
    return refused([&](Files& files) {
      std::string text = text_of(files[0].second);
      REQUIRE(text.find(from) != std::string::npos);
      text.replace(text.find(from), from.size(), to);
      files[0].second = bytes_of(text);
    });
  };
  CHECK(refused([](Files& files) { files.erase(files.begin()); }).message.find("index.csv") !=
        std::string::npos);
  CHECK(refused([](Files& files) { files.erase(files.begin() + 2); }).message.find("tiles/000001.drc") !=
        std::string::npos);
  const Error other = refused([&](Files& files) {
    files[2].second = write_cloud(sphere(100).cloud, CloudFormat::kDraco, {}).value();
  });
  CHECK(other.code == ErrorCode::kMalformedData);
  CHECK(other.message.find("tiles/000001.drc") != std::string::npos);
  CHECK(refused([](Files& files) { files[3].second.resize(40); }).code == ErrorCode::kMalformedData);
  CHECK(index_with("000001.drc,100", "000001.drc,99").code == ErrorCode::kTooLarge);
  CHECK(index_with("000001.drc,100", "000001.drc,101").message.find("000001.drc") != std::string::npos);
  CHECK(index_with("000001.drc,100", "000000.drc,100").message.find("line 3") != std::string::npos);
  CHECK(index_with("000001.drc,100", "000001.drc,0").message.find("line 3") != std::string::npos);
  CHECK(index_with("sample_count", "samples").code == ErrorCode::kMalformedData);
  CHECK(index_with(",100,", ",18446744073709551615,").code == ErrorCode::kTooLarge);
  CHECK(refused([](Files& files) { files[0].second = bytes_of(draco_tiles_index({})); }).code ==
        ErrorCode::kEmptyCloud);
  CHECK(refused([](Files& files) { files.push_back(files[2]); }).message.find("twice") != std::string::npos);
  // A good tile that goes on and on, and an index that does.
  CHECK(refused([](Files& files) { files[2].second.resize(std::size_t{2} << 20U); }).code ==
        ErrorCode::kTooLarge);
  std::string many(draco_tiles_index({}));
  for (int k = 0; k <= 1 << 18; ++k) many += std::to_string(k) + ",1,0,0,0,0,0,0\n";
  CHECK(parse_draco_tiles_index(many, std::uint64_t{1} << 40U).error().code == ErrorCode::kTooLarge);
  CHECK(error_of(whole, CloudFormat::kDracoTiles, {.max_samples = 299}).code == ErrorCode::kTooLarge);
  for (std::size_t length = 0; length < whole.size(); length += 97) {
    const auto cut = std::span(whole).first(length);
    CHECK_FALSE(read_cloud(cut, CloudFormat::kDracoTiles, {}).ok());
  }
  Random random(7);
  for (int k = 0; k < 300; ++k) {
    auto mutant = whole;
    for (int n = 0; n < 4; ++n) mutant[random.below(mutant.size())] = static_cast<std::byte>(random.next());
    const auto read = read_cloud(mutant, CloudFormat::kDracoTiles, {.drop_non_finite = true});
    if (!read.ok()) CHECK_FALSE(read.error().message.empty());
  }
  // Any other archive is told what to do instead.
  const auto stray = archive_of({{"scan.ply", bytes_of("ply")}});
  CHECK(detect_format(stray).error().code == ErrorCode::kUnsupportedFormat);
}

TEST_CASE("files with names that this program's locale cannot say are nobody's business") {
  // "läser.txt", marked as UTF-8, between the index and the tile.
  const auto seed = std::filesystem::path(POINTWRIGHT_CORPUS_DIR) / "draco_tiles" / "utf8_name.zip";
  std::ifstream file(seed, std::ios::binary);
  const auto bytes = bytes_of(std::string(std::istreambuf_iterator<char>(file), {}));
  const auto read = read_cloud(bytes, CloudFormat::kDracoTiles, {});
  REQUIRE_MESSAGE(read.ok(), why(read));
  CHECK(read.value().cloud.size() == 4);
}

TEST_CASE("what an archive cannot take is told, and its files are as long as they were said to be") {
  const std::vector<ZipEntry> entries{
      {.name = "a", .bytes = 3, .content = [] { return Result(bytes_of("abc")); }}};
  int taken = 0;
  CHECK_FALSE(write_zip(entries, [&](std::span<const std::byte>) { return ++taken > 100; }).ok());
  std::vector<ZipEntry> wrong = entries;
  wrong[0].bytes = 4;
  CHECK_FALSE(write_zip(wrong, [](std::span<const std::byte>) { return true; }).ok());
  const auto archive = archive_of({{"a", bytes_of("abc")}});
  auto reader = ZipReader::open(archive);
  REQUIRE(reader.ok());
  REQUIRE(reader.value().next().ok());
  CHECK(reader.value().content(2).error().code == ErrorCode::kTooLarge);
}

}  // namespace
}  // namespace pointwright::io_test
