#include "server/store/archive.h"

#include <algorithm>

#include "server/base/sha256.h"
#include "server/store/row_time.h"

namespace pointwright::server {

using protocol::Json;
using protocol::JsonDocument;
using protocol::Problem;
using protocol::ProblemKind;

namespace {

JsonDocument list_of(const std::vector<std::string>& texts) {
  JsonDocument list = JsonDocument::array();
  for (const std::string& text : texts) list.push_back(text);
  return list;
}

Vec3d vector_of(const Json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

CloudFormat format_of(const std::string& name) {
  for (int i = 0; i <= static_cast<int>(kLastCloudFormat); ++i)
    if (format_name(static_cast<CloudFormat>(i)) == name) return static_cast<CloudFormat>(i);
  throw std::runtime_error("a cloud format that is none");
}

JsonDocument to_row(const AttributeRange& range) {
  return {{"name", range.name},
          {"type", range.type},
          {"min", range.min},
          {"max", range.max},
          {"non_finite", range.non_finite}};
}

JsonDocument to_row(const protocol::CloudDocument& cloud) {
  const ImportReport& report = cloud.report;
  JsonDocument ranges = JsonDocument::array();
  for (const AttributeRange& range : report.ranges) ranges.push_back(to_row(range));
  JsonDocument grid;  // null where there is none
  if (report.grid)
    grid = {{"scale", protocol::to_json(report.grid->scale)},
            {"offset", protocol::to_json(report.grid->offset)}};
  return {{"name", cloud.name},
          {"bytes", cloud.bytes},
          {"created", to_ms(cloud.created)},
          {"origin", protocol::to_json(cloud.origin)},
          {"bounds_min", protocol::to_json(report.bounds_min)},
          {"bounds_max", protocol::to_json(report.bounds_max)},
          {"samples", report.sample_count},
          {"format", format_name(report.format)},
          {"encoding", report.encoding},
          {"declared", report.declared_count},
          {"dropped", report.dropped_non_finite},
          {"duplicates", report.duplicate_count},
          {"mesh", report.from_mesh},
          {"double", report.position_is_double},
          {"attributes", list_of(report.attributes)},
          {"skipped", list_of(report.skipped)},
          {"normals", static_cast<int>(report.normals)},
          {"ranges", std::move(ranges)},
          {"spacing", report.spacing},
          {"step", protocol::to_json(report.step)},
          {"grid", std::move(grid)},
          {"warnings", list_of(report.warnings)}};
}

/// Throws what the JSON library throws where the text is not what to_row() makes.
protocol::CloudDocument cloud_document(const std::string& id, const std::string& sha256,
                                       const std::string& text) {
  const Json row = Json::parse(text);
  protocol::CloudDocument document{.id = id,
                                   .name = row.at("name").get<std::string>(),
                                   .sha256 = sha256,
                                   .bytes = row.at("bytes").get<std::uint64_t>(),
                                   .created = from_ms(row.at("created").get<std::int64_t>()),
                                   .origin = vector_of(row.at("origin")),
                                   .report = {}};
  ImportReport& report = document.report;
  report.bounds_min = vector_of(row.at("bounds_min"));
  report.bounds_max = vector_of(row.at("bounds_max"));
  report.sample_count = row.at("samples").get<std::uint64_t>();
  report.format = format_of(row.at("format").get<std::string>());
  report.encoding = row.at("encoding").get<std::string>();
  report.declared_count = row.at("declared").get<std::uint64_t>();
  report.dropped_non_finite = row.at("dropped").get<std::uint64_t>();
  report.duplicate_count = row.at("duplicates").get<std::uint64_t>();
  report.from_mesh = row.at("mesh").get<bool>();
  report.position_is_double = row.at("double").get<bool>();
  report.attributes = row.at("attributes").get<std::vector<std::string>>();
  report.skipped = row.at("skipped").get<std::vector<std::string>>();
  report.normals = static_cast<NormalQuality>(row.at("normals").get<int>());
  for (const Json& range : row.at("ranges"))
    report.ranges.push_back({.name = range.at("name").get<std::string>(),
                             .type = range.at("type").get<std::string>(),
                             .min = range.at("min").get<double>(),
                             .max = range.at("max").get<double>(),
                             .non_finite = range.at("non_finite").get<std::uint64_t>()});
  report.spacing = row.at("spacing").get<double>();
  report.step = vector_of(row.at("step"));
  if (const Json& grid = row.at("grid"); !grid.is_null())
    report.grid = PositionGrid{.scale = vector_of(grid.at("scale")), .offset = vector_of(grid.at("offset"))};
  report.warnings = row.at("warnings").get<std::vector<std::string>>();
  return document;
}

protocol::ImageDocument image_document(const std::string& id, const std::string& text) {
  const Json row = Json::parse(text);
  return {.id = id,
          .width = row.at("width").get<std::uint64_t>(),
          .height = row.at("height").get<std::uint64_t>(),
          .channels = row.at("channels").get<std::vector<std::string>>(),
          .bytes = row.at("bytes").get<std::uint64_t>(),
          .created = from_ms(row.at("created").get<std::int64_t>())};
}

std::string params_row(const KeptSession& session) {
  JsonDocument scales = JsonDocument::array();
  for (const float scale : session.params.scales) scales.push_back(double{scale});
  JsonDocument row{{"name", session.name},
                   {"scales", std::move(scales)},
                   {"neighbors", session.params.neighbors},
                   {"created", to_ms(session.created)}};
  if (session.preview) row["preview"] = {{"count", session.preview->count}, {"of", session.preview->of}};
  return protocol::to_text(row);
}

void read_params(KeptSession& session, const std::string& text) {
  const Json row = Json::parse(text);
  session.name = row.at("name").get<std::string>();
  session.created = from_ms(row.at("created").get<std::int64_t>());
  session.params.neighbors = row.at("neighbors").get<std::uint32_t>();
  if (const auto preview = row.find("preview"); preview != row.end())
    session.preview = {.count = preview->at("count").get<std::uint64_t>(),
                       .of = preview->at("of").get<std::uint64_t>()};
  session.params.scales.clear();
  for (const Json& scale : row.at("scales"))
    session.params.scales.push_back(static_cast<float>(scale.get<double>()));
}

}  // namespace

std::string row_seal(std::initializer_list<std::string_view> columns) {
  std::string all;
  for (const std::string_view column : columns) {
    all += std::to_string(column.size());
    all += ':';
    all += column;
  }
  constexpr std::size_t kDigits = 32;
  return sha256_hex(std::as_bytes(std::span(all.data(), all.size()))).substr(0, kDigits);
}

Outcome<Done> Archive::add(const KeptCloud& cloud, const BlobContent& file, const KeptAnswer* answer) {
  auto pin = blobs_.put(cloud.document.sha256, file);
  if (!pin.ok()) return pin.problem();
  const std::string document = protocol::to_text(to_row(cloud.document));
  const std::string source = protocol::to_text(
      JsonDocument{{"format", format_name(cloud.source.format)}, {"drop", cloud.source.drop_non_finite}});
  const std::string seal =
      row_seal({cloud.document.id, cloud.owner, document, source, cloud.content, cloud.document.sha256});
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run(
        "INSERT INTO clouds (id, owner, document, source, content, sha256, seal) VALUES (?, ?, ?, ?, ?, ?, "
        "?)",
        cloud.document.id, cloud.owner, document, source, cloud.content, cloud.document.sha256, seal);
    if (answer != nullptr) Answers::put(access, *answer);
    return Done{};
  });
}

Outcome<Done> Archive::add(const KeptImage& image, std::span<const std::byte> file,
                           const KeptAnswer* answer) {
  auto pin = blobs_.put(image.sha256, file);
  if (!pin.ok()) return pin.problem();
  const std::string document = protocol::to_text(JsonDocument{{"width", image.document.width},
                                                              {"height", image.document.height},
                                                              {"channels", list_of(image.document.channels)},
                                                              {"bytes", image.document.bytes},
                                                              {"created", to_ms(image.document.created)}});
  const std::string seal = row_seal({image.document.id, image.owner, document, image.sha256});
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("INSERT INTO images (id, owner, document, sha256, seal) VALUES (?, ?, ?, ?, ?)",
               image.document.id, image.owner, document, image.sha256, seal);
    if (answer != nullptr) Answers::put(access, *answer);
    return Done{};
  });
}

Outcome<Done> Archive::add(const KeptSession& session, const KeptAnswer* answer) {
  const std::string params = params_row(session);
  const std::string params_seal = row_seal({session.id, session.owner, session.cloud, params});
  // As Keeper::keep() seals a session without paintings and edits.
  const std::string seal = row_seal({session.id, "0", "0", "0", "0", "0"});
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run(
        "INSERT INTO sessions (id, owner, cloud, params, params_seal, revision, head, samples, used, seal) "
        "VALUES (?, ?, ?, ?, ?, 0, 0, ?, ?, ?)",
        session.id, session.owner, session.cloud, params, params_seal, session.samples, to_ms(session.used),
        seal);
    if (answer != nullptr) Answers::put(access, *answer);
    return Done{};
  });
}

Outcome<Done> Archive::remove_cloud(const std::string& id, const std::string& sha256) {
  auto removed = database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("DELETE FROM clouds WHERE id = ?", id);
    return Done{};
  });
  if (removed.ok()) blobs_.drop(sha256, is_used());
  return removed;
}

Outcome<Done> Archive::remove_image(const std::string& id, const std::string& sha256) {
  auto removed = database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("DELETE FROM images WHERE id = ?", id);
    return Done{};
  });
  if (removed.ok()) blobs_.drop(sha256, is_used());
  return removed;
}

Outcome<Done> Archive::remove_session(const std::string& id) {
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("DELETE FROM sessions WHERE id = ?", id);
    return Done{};
  });
}

std::vector<KeptCloud> Archive::clouds(std::size_t& damaged) {
  return database_.read([&](Database::Access& access) {
    std::vector<KeptCloud> clouds;
    Statement row =
        access.query("SELECT id, owner, document, source, content, sha256, seal FROM clouds ORDER BY place");
    while (row.step()) {
      try {
        const std::string sha256 = row.text(5);
        KeptCloud cloud{.document = cloud_document(row.text(0), sha256, row.text(2)),
                        .source = {},
                        .content = row.text(4),
                        .owner = row.text(1)};
        const Json source = Json::parse(row.text(3));
        cloud.source = {.format = format_of(source.at("format").get<std::string>()),
                        .drop_non_finite = source.at("drop").get<bool>()};
        const bool is_whole = row.text(6) == row_seal({row.text(0), row.text(1), row.text(2), row.text(3),
                                                       row.text(4), row.text(5)});
        if (is_whole) clouds.push_back(std::move(cloud));
        if (!is_whole) ++damaged;
      } catch (const DatabaseError&) {
        throw;
      } catch (const std::exception&) {
        ++damaged;
      }
    }
    return clouds;
  });
}

std::vector<KeptImage> Archive::images(std::size_t& damaged) {
  return database_.read([&](Database::Access& access) {
    std::vector<KeptImage> images;
    Statement row = access.query("SELECT id, owner, document, sha256, seal FROM images ORDER BY place");
    while (row.step()) {
      try {
        KeptImage image{.document = image_document(row.text(0), row.text(2)),
                        .sha256 = row.text(3),
                        .owner = row.text(1)};
        const bool is_whole = row.text(4) == row_seal({row.text(0), row.text(1), row.text(2), row.text(3)});
        if (is_whole) images.push_back(std::move(image));
        if (!is_whole) ++damaged;
      } catch (const DatabaseError&) {
        throw;
      } catch (const std::exception&) {
        ++damaged;
      }
    }
    return images;
  });
}

std::vector<KeptSession> Archive::sessions() {
  return database_.read([&](Database::Access& access) {
    std::vector<KeptSession> sessions;
    Statement row = access.query(
        "SELECT id, owner, cloud, params, params_seal, revision, head, samples, used, damage FROM sessions "
        "ORDER BY place");
    while (row.step()) {
      KeptSession session;
      session.id = row.text(0);
      session.owner = row.text(1);
      session.cloud = row.text(2);
      session.revision = static_cast<std::uint64_t>(row.integer(5));
      session.head = static_cast<std::uint64_t>(row.integer(6));
      session.samples = static_cast<std::uint64_t>(row.integer(7));
      session.used = from_ms(row.integer(8));
      if (!row.is_null(9)) session.damage = row.text(9);
      try {
        read_params(session, row.text(3));
        if (row.text(4) != row_seal({session.id, session.owner, session.cloud, row.text(3)}))
          session.damage = "what is stored of its levels is damaged";
      } catch (const Json::exception&) {
        session.damage = "what is stored of its levels is damaged";
      }
      sessions.push_back(std::move(session));
    }
    return sessions;
  });
}

BlobStore::IsUsed Archive::is_used() {
  return [this](const std::string& sha256) {
    return database_.read([&](Database::Access& access) {
      Statement used = access.query(
          "SELECT 1 FROM clouds WHERE sha256 = ?1 UNION ALL SELECT 1 FROM images WHERE sha256 = ?1 LIMIT 1",
          sha256);
      return used.step();
    });
  };
}

bool Archive::has_file(int file) {
  try {
    const std::string sha256 = blobs_.name_of(file);
    return !sha256.empty() && is_used()(sha256);
  } catch (const DatabaseError&) {
    return false;  // nobody can tell
  }
}

void Archive::sweep() {
  blobs_.sweep(is_used());
  // Paintings of edits that were undone and replaced.
  (void)database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run(
        "DELETE FROM paintings WHERE NOT EXISTS (SELECT 1 FROM edits WHERE edits.session = paintings.session "
        "AND edits.marks = paintings.hash)");
    return Done{};
  });
}

}  // namespace pointwright::server
