#include <doctest/doctest.h>
#include <draco/compression/encode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <draco/point_cloud/point_cloud_builder.h>

#include <cmath>
#include <limits>

#include "engine/io/draco_codec.h"
#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

std::vector<std::byte> taken(const draco::EncoderBuffer& buffer) {
  const auto* begin = reinterpret_cast<const std::byte*>(buffer.data());
  return {begin, begin + buffer.size()};
}

ImportedCloud read(std::span<const std::byte> bytes) {
  auto result = read_cloud(bytes, CloudFormat::kDraco, {});
  INFO(why(result));
  REQUIRE(result.ok());
  return std::move(result).value();
}

// A cloud encoded by the library itself, with positions of a type of the caller's choice.
template <typename T>
std::vector<std::byte> encoded(const std::vector<std::array<T, 3>>& samples, draco::DataType type,
                               int method) {
  draco::PointCloudBuilder builder;
  builder.Start(static_cast<draco::PointIndex::ValueType>(samples.size()));
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, type);
  for (std::uint32_t i = 0; i < samples.size(); ++i) {
    builder.SetAttributeValueForPoint(id, draco::PointIndex(i), samples[i].data());
  }
  const auto cloud = builder.Finalize(false);
  draco::ExpertEncoder encoder(*cloud);
  encoder.SetEncodingMethod(method);
  if (type == draco::DT_FLOAT32 && method == draco::POINT_CLOUD_KD_TREE_ENCODING) {
    encoder.SetAttributeQuantization(id, 16);
  }
  draco::EncoderBuffer buffer;
  REQUIRE(encoder.EncodeToBuffer(&buffer).ok());
  return taken(buffer);
}

TEST_CASE("every attribute comes back from Draco to the bit, wherever the cloud stands") {
  for (const Place place : {Place::kNearZero, Place::kFarFloat, Place::kFarDouble, Place::kNearDouble}) {
    for (const bool caller_order : {false, true}) {
      CAPTURE(static_cast<int>(place));
      const Cloud cloud = cloud_with_everything(300, place).cloud;
      Cloud again = through(cloud, CloudFormat::kDraco, {.caller_order = caller_order}).cloud;
      if (!caller_order) again.id = cloud.id;
      CHECK(difference(again, cloud) == "");
    }
  }
}

TEST_CASE("the origin of a far cloud stands in the metadata, and its positions stay float32") {
  const Cloud cloud = cloud_with_everything(50, Place::kFarFloat).cloud;
  const auto bytes = write_cloud(cloud, CloudFormat::kDraco, {}).value();
  CHECK(text_of(bytes).find(kDracoOriginKey) != std::string::npos);
  const ImportedCloud again = read(bytes);
  CHECK(again.cloud.origin == cloud.origin);
  CHECK_FALSE(again.report.position_is_double);
}

TEST_CASE("double positions that float32 holds around the origin leave as float32 and come back as doubles") {
  const Cloud cloud =
      read_text(
          "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double "
          "z\nend_header\n1000000.5 2 3\n1000001.25 3 4\n",
          CloudFormat::kPly)
          .cloud;
  REQUIRE(cloud.exact_position.empty());
  CHECK(difference(through(cloud, CloudFormat::kDraco).cloud, cloud) == "");
}

TEST_CASE("quantised positions lie within half a step of the true ones") {
  for (const Place place : {Place::kNearZero, Place::kFarDouble}) {
    const Cloud cloud = in_caller_order(cloud_with_everything(1000, place).cloud);
    for (const int bits : {8, 12, 16}) {
      const Cloud again =
          in_caller_order(through(cloud, CloudFormat::kDraco, {.draco_position_bits = bits}).cloud);
      const double step = 200.0 / static_cast<double>((1 << bits) - 1);
      double worst = 0.0;
      for (std::size_t i = 0; i < cloud.size(); ++i) {
        worst = std::max(worst, (model_position(cloud, i) - model_position(again, i)).cwiseAbs().maxCoeff());
      }
      CHECK(worst <= 0.51 * step + 1e-4);
      CHECK(worst > 0.1 * step);
      CHECK(again.color == cloud.color);
    }
  }
}

TEST_CASE("quantised positions are entropy-coded where that saves much, and plain where it hardly does") {
  constexpr std::size_t kSamples = 20'000;
  constexpr std::size_t kPlainBytes = kSamples * 3 * 2;  // 14 bits in two whole bytes
  const Cloud cloud = sphere(kSamples).cloud;            // the caller's order is random
  const auto written = [&](bool caller_order) {
    return write_cloud(cloud, CloudFormat::kDraco, {.caller_order = caller_order, .draco_position_bits = 14})
        .value();
  };
  const auto shuffled = written(true);
  const auto ordered = written(false);
  CHECK(shuffled.size() > kPlainBytes);
  CHECK(shuffled.size() < kPlainBytes + 100);
  CHECK(ordered.size() < kPlainBytes * 5 / 6);
  CHECK(read(shuffled).cloud.position == read(ordered).cloud.position);
}

TEST_CASE("integers at the ends of their types survive, alone and together") {
  for (const std::size_t count : {1U, 2U, 5U}) {
    const Cloud cloud = cloud_with_everything(count, Place::kNearZero, count).cloud;
    CHECK(difference(through(cloud, CloudFormat::kDraco).cloud, cloud) == "");
  }
}

TEST_CASE("integers of any span survive, positions quantised or not") {
  constexpr std::size_t kSamples = 300;
  for (const std::uint32_t span : {1U << 20U, 1U << 29U, 1U << 30U, 2147483645U, 4294967295U}) {
    Cloud cloud = in_caller_order(sphere(kSamples).cloud);
    std::vector<std::uint32_t> values;
    std::vector<std::int32_t> around_zero;
    Random random(span);
    for (std::size_t i = 0; i < kSamples; ++i) {
      const double part = i % 3 == 0 ? 0.0 : i % 3 == 1 ? 1.0 : random.uniform(0.0, 1.0);
      values.push_back(static_cast<std::uint32_t>(part * span));
      around_zero.push_back(static_cast<std::int32_t>(std::floor((part - 0.5) * span)));
    }
    cloud.scalars = {{"value", values}, {"around_zero", around_zero}};
    for (const int bits : {0, 14}) {
      CAPTURE(span);
      CAPTURE(bits);
      const Cloud again =
          in_caller_order(through(cloud, CloudFormat::kDraco, {.draco_position_bits = bits}).cloud);
      CHECK(again.scalars == cloud.scalars);
    }
  }
}

TEST_CASE("names with odd characters survive as far as PLY can carry them") {
  Cloud cloud = sphere(3).cloud;
  cloud.scalars = {{"höhe", std::vector<float>{1, 2, 3}}, {"höhe", std::vector<float>{4, 5, 6}}};
  const Cloud again = through(cloud, CloudFormat::kDraco).cloud;
  CHECK(again.scalars[0].name == "höhe");
  CHECK(again.scalars[1].name == "scalar_höhe");
}

TEST_CASE("positions of other types, and files of the kd-tree method, are read") {
  const std::vector<std::array<std::int32_t, 3>> ints{{-5, 7, 100000}, {20, -30, 5}, {0, 0, 1}};
  for (const int method : {draco::POINT_CLOUD_SEQUENTIAL_ENCODING}) {
    const Cloud cloud = in_caller_order(read(encoded(ints, draco::DT_INT32, method)).cloud);
    CHECK(model_position(cloud, 0) == Vec3d(-5, 7, 100000));
  }
  const std::vector<std::array<double, 3>> doubles{{0.1, 5648349.895035, 3}, {4, 5648350.5, 6}};
  const Cloud exact = in_caller_order(
      read(encoded(doubles, draco::DT_FLOAT64, draco::POINT_CLOUD_SEQUENTIAL_ENCODING)).cloud);
  CHECK(model_position(exact, 0) == Vec3d(0.1, 5648349.895035, 3));
  std::vector<std::array<float, 3>> floats;
  Random random(2);
  for (int i = 0; i < 200; ++i) {
    floats.push_back({static_cast<float>(random.uniform(0, 1)), static_cast<float>(random.uniform(0, 1)),
                      static_cast<float>(random.uniform(0, 1))});
  }
  const ImportedCloud tree = read(encoded(floats, draco::DT_FLOAT32, draco::POINT_CLOUD_KD_TREE_ENCODING));
  CHECK(tree.report.encoding == "kd_tree");
  CHECK(tree.cloud.size() == 200);
}

std::vector<std::byte> encoded_mesh(int method) {
  // A strip of triangles over a wavy line.
  constexpr int kFaces = 20;
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(kFaces);
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const auto at = [](int i) {
    return std::array{static_cast<float>(i / 2), static_cast<float>(i % 2), static_cast<float>((i * i) % 5)};
  };
  for (int f = 0; f < kFaces; ++f) {
    const auto a = at(f);
    const auto b = at(f + 1);
    const auto c = at(f + 2);
    builder.SetAttributeValuesForFace(id, draco::FaceIndex(static_cast<std::uint32_t>(f)), a.data(), b.data(),
                                      c.data());
  }
  const auto mesh = builder.Finalize();
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method);
  draco::EncoderBuffer buffer;
  REQUIRE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
  return taken(buffer);
}

TEST_CASE("meshes are taken for their vertices") {
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const ImportedCloud mesh = read(encoded_mesh(method));
    CHECK(mesh.report.from_mesh);
    // A method may keep a vertex once for each corner of a triangle.
    CHECK(mesh.cloud.size() - mesh.report.duplicate_count == 22);
    CHECK(mesh.report.bounds_max == Vec3d(10, 1, 4));
  }
}

TEST_CASE("a file without positions, or with too few coordinates, is refused") {
  for (const auto& [kind, components] :
       {std::pair{draco::GeometryAttribute::GENERIC, 3}, {draco::GeometryAttribute::POSITION, 2}}) {
    draco::PointCloudBuilder builder;
    builder.Start(3);
    const int id = builder.AddAttribute(kind, static_cast<std::int8_t>(components), draco::DT_FLOAT32);
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::array values{static_cast<float>(i), 1.0F, 2.0F};
      builder.SetAttributeValueForPoint(id, draco::PointIndex(i), values.data());
    }
    const auto cloud = builder.Finalize(false);
    draco::ExpertEncoder encoder(*cloud);
    encoder.SetEncodingMethod(draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
    draco::EncoderBuffer buffer;
    REQUIRE(encoder.EncodeToBuffer(&buffer).ok());
    CHECK(error_of(taken(buffer), CloudFormat::kDraco).code == ErrorCode::kMalformedData);
  }
}

TEST_CASE("coordinates that are not finite are found in Draco files too") {
  const std::vector<std::array<float, 3>> samples{{1, 2, 3}, {std::numeric_limits<float>::quiet_NaN(), 0, 0}};
  const auto bytes = encoded(samples, draco::DT_FLOAT32, draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
  CHECK(error_of(bytes, CloudFormat::kDraco).code == ErrorCode::kNonFinite);
}

TEST_CASE("an origin in the metadata that is no place is refused") {
  Cloud cloud = cloud_with_everything(5, Place::kFarFloat).cloud;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), 1e300}) {
    cloud.origin.x() = bad;
    const auto bytes = write_cloud(cloud, CloudFormat::kDraco, {.draco_position_bits = 0});
    REQUIRE(bytes.ok());
    CHECK_FALSE(read_cloud(bytes.value(), CloudFormat::kDraco, {}).ok());
  }
}

TEST_CASE("a Draco file cut at any byte is refused") {
  const auto whole =
      write_cloud(cloud_with_everything(4, Place::kFarFloat).cloud, CloudFormat::kDraco, {}).value();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    CHECK_FALSE(read_cloud(std::span(whole).first(length), CloudFormat::kDraco, {}).ok());
  }
}

}  // namespace
}  // namespace pointwright::io_test
