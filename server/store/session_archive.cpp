// Sessions in the archive: what is written with each change, and what is read when one comes back.

#include <sqlite3.h>

#include <algorithm>

#include "protocol/json/requests.h"
#include "server/base/sha256.h"
#include "server/store/archive.h"
#include "server/store/marks_code.h"

namespace pointwright::server {

using protocol::Json;
using protocol::JsonDocument;
using protocol::Problem;
using protocol::ProblemKind;

namespace {

/// As much as was ever recorded: the limits held when it was.
constexpr protocol::ParseLimits kNoLimits{
    .max_bytes = std::size_t{1} << 40U, .max_depth = 32, .max_values = std::size_t{1} << 40U};

Problem damaged(const std::string& what) {
  return {.kind = ProblemKind::kDamaged, .detail = "what is stored of the session is damaged: " + what};
}

std::size_t size_of(const Painting& painting) {
  return painting.operations == nullptr ? 0 : painting.operations->size();
}

/// Which rows the session has.
std::string session_seal(const std::string& id, const Document& document) {
  const std::string revision = std::to_string(document.revision);
  const std::string head = std::to_string(document.head);
  const std::string zero = std::to_string(size_of(document.zero));
  const std::string one = std::to_string(size_of(document.one));
  const std::string edits = std::to_string(document.edits->size());
  if (document.named == nullptr || document.named->empty())
    return row_seal({id, revision, head, zero, one, edits});
  std::string named;
  for (const auto& [name, region] : *document.named)
    named += name + "=" + std::to_string(size_of(region.painting)) + ";";
  return row_seal({id, revision, head, zero, one, edits, named});
}

/// How many entries two lists start with in common.
template <typename List>
std::size_t common_start(const std::shared_ptr<const List>& a, const std::shared_ptr<const List>& b) {
  if (a == nullptr || b == nullptr) return 0;
  const auto [end, other] = std::mismatch(a->begin(), a->end(), b->begin(), b->end());
  return static_cast<std::size_t>(end - a->begin());
}

std::string edit_row(const RecordedEdit& edit) {
  const auto created =
      std::chrono::duration_cast<std::chrono::milliseconds>(edit.created.time_since_epoch()).count();
  return protocol::to_text(JsonDocument{{"edit", protocol::to_json(edit.params)},
                                        {"created", created},
                                        {"moved", edit.moved_samples},
                                        {"zero", edit.zero_samples},
                                        {"one", edit.one_samples},
                                        {"inserted", edit.change.inserted},
                                        {"removed", edit.change.removed},
                                        {"samples", edit.sample_count},
                                        {"surface", edit.surface_hash}});
}

std::shared_ptr<RecordedEdit> edit_of(std::size_t index, const std::string& text) {
  const Json row = Json::parse(text);
  auto params = protocol::parse_edit(row.at("edit"));
  if (!params) return nullptr;
  auto edit = std::make_shared<RecordedEdit>();
  edit->index = index;
  edit->params = std::move(params).value();
  edit->created = protocol::TimePoint(std::chrono::milliseconds(row.at("created").get<std::int64_t>()));
  edit->moved_samples = row.at("moved").get<std::size_t>();
  edit->zero_samples = row.at("zero").get<std::size_t>();
  edit->one_samples = row.at("one").get<std::size_t>();
  edit->change = {.inserted = row.at("inserted").get<std::size_t>(),
                  .removed = row.at("removed").get<std::size_t>()};
  edit->sample_count = row.at("samples").get<std::size_t>();
  edit->surface_hash = row.at("surface").get<std::string>();
  return edit;
}

SharedMarks shared_marks(std::span<const std::byte> runs) {
  auto marks = decode_marks(runs);
  return marks ? std::make_shared<const Marks>(std::move(*marks)) : nullptr;
}

/// One new edit on its way to the disk.
struct EditRow {
  std::int64_t number = 0;
  std::string record;
  std::string marks;            // hash of the runs
  std::vector<std::byte> runs;  // empty: those of the edit before
};

std::vector<EditRow> new_edits(const EditList& edits, std::size_t known) {
  std::vector<EditRow> rows;
  for (std::size_t i = known; i < edits.size(); ++i) {
    EditRow row{
        .number = static_cast<std::int64_t>(i) + 1, .record = edit_row(*edits[i]), .marks = {}, .runs = {}};
    if (i > known && edits[i]->marks == edits[i - 1]->marks) {
      row.marks = rows.back().marks;
    } else {
      row.runs = encode_marks(*edits[i]->marks);
      row.marks = sha256_hex(row.runs);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

/// Where the operations of regions stand: those of zero and one by number, others by name.
struct OperationTable {
  std::string_view forget;
  std::string_view insert;
  std::string_view select;
};
constexpr OperationTable kOperations{
    .forget = "DELETE FROM operations WHERE session = ? AND region = ? AND number >= ?",
    .insert = "INSERT INTO operations (session, region, number, operation, seal) VALUES (?, ?, ?, ?, ?)",
    .select =
        "SELECT number, operation, seal FROM operations WHERE session = ? AND region = ? ORDER BY number"};
constexpr OperationTable kRegionOperations{
    .forget = "DELETE FROM region_operations WHERE session = ? AND region = ? AND number >= ?",
    .insert =
        "INSERT INTO region_operations (session, region, number, operation, seal) VALUES (?, ?, ?, ?, ?)",
    .select =
        "SELECT number, operation, seal FROM region_operations WHERE session = ? AND region = ? "
        "ORDER BY number"};

std::string text_of(std::int64_t region) {
  return std::to_string(region);
}
const std::string& text_of(const std::string& region) {
  return region;
}

template <typename Region>
void write_painting(Database::Access& access, const OperationTable& table, const std::string& id,
                    const Region& region, const Painting& before, const Painting& after) {
  if (before.operations == after.operations) return;
  const std::size_t known = common_start(before.operations, after.operations);
  if (known < size_of(before)) access.run(table.forget, id, region, static_cast<std::int64_t>(known));
  for (std::size_t i = known; i < size_of(after); ++i) {
    const std::string text = protocol::to_text(protocol::to_json(*(*after.operations)[i]));
    const std::string seal = row_seal({id, text_of(region), std::to_string(i), text});
    access.run(table.insert, id, region, static_cast<std::int64_t>(i), text, seal);
  }
}

template <typename Region>
Outcome<Painting> read_painting(Database::Access& access, const OperationTable& table, const std::string& id,
                                const Region& region) {
  auto operations = std::make_shared<OperationList>();
  Painting painting;
  Statement row = access.query(table.select, id, region);
  while (row.step()) {
    const std::string text = row.text(1);
    const bool is_next = static_cast<std::size_t>(row.integer(0)) == operations->size();
    if (!is_next || row.text(2) != row_seal({id, text_of(region), std::to_string(operations->size()), text}))
      return damaged("a painting");
    auto operation = protocol::parse_body(text, kNoLimits, protocol::parse_paint_operation);
    if (!operation) return damaged("a painting");
    painting.vertices += vertex_count(operation.value().shape);
    operations->push_back(std::make_shared<const PaintOperation>(std::move(operation).value()));
  }
  painting.operations = std::move(operations);
  return painting;
}

const NamedRegion* find(const SharedNamedRegions& regions, const std::string& name) {
  if (regions == nullptr) return nullptr;
  const auto found = regions->find(name);
  return found == regions->end() ? nullptr : &found->second;
}

void write_regions(Database::Access& access, const std::string& id, const SharedNamedRegions& before,
                   const SharedNamedRegions& after) {
  if (before == after) return;
  if (before != nullptr)
    for (const auto& [name, region] : *before)
      if (find(after, name) == nullptr)
        access.run("DELETE FROM regions WHERE session = ? AND name = ?", id, name);
  if (after == nullptr) return;
  for (const auto& [name, region] : *after) {
    const NamedRegion* const known = find(before, name);
    if (known == nullptr || known->by_id != region.by_id) {
      const std::vector<std::byte> members = encode_marks(*region.by_id);
      // Not replaced: the operations refer to the row.
      access.run(
          "INSERT INTO regions (session, name, members, seal) VALUES (?1, ?2, ?3, ?4) ON CONFLICT (session, "
          "name) DO UPDATE SET members = ?3, seal = ?4",
          id, name, std::span<const std::byte>(members), row_seal({id, name, sha256_hex(members)}));
    }
    write_painting(access, kRegionOperations, id, name, known == nullptr ? Painting{} : known->painting,
                   region.painting);
  }
}

Outcome<SharedNamedRegions> read_regions(Database::Access& access, const std::string& id) {
  NamedRegions regions;
  {
    Statement row = access.query("SELECT name, members, seal FROM regions WHERE session = ?", id);
    while (row.step()) {
      const std::string name = row.text(0);
      if (row.text(2) != row_seal({id, name, sha256_hex(row.content(1))})) return damaged("a region");
      auto members = shared_marks(row.content(1));
      if (members == nullptr) return damaged("a region");
      regions[name].by_id = std::move(members);
    }
  }
  for (auto& [name, region] : regions) {
    auto painting = read_painting(access, kRegionOperations, id, name);
    if (!painting.ok()) return painting.problem();
    region.painting = std::move(painting.value());
  }
  if (regions.empty()) return SharedNamedRegions();
  return SharedNamedRegions(std::make_shared<const NamedRegions>(std::move(regions)));
}

Outcome<EditList> read_edits(Database::Access& access, const std::string& id) {
  EditList edits;
  std::string last_hash;
  Statement row = access.query(
      "SELECT edits.number, edits.record, edits.marks, edits.seal, paintings.runs FROM edits LEFT JOIN "
      "paintings "
      "ON paintings.session = edits.session AND paintings.hash = edits.marks WHERE edits.session = ? ORDER "
      "BY "
      "edits.number",
      id);
  while (row.step()) {
    const std::string number = std::to_string(edits.size() + 1);
    const std::string hash = row.text(2);
    if (std::to_string(row.integer(0)) != number || row.text(3) != row_seal({id, number, row.text(1), hash}))
      return damaged("an edit");
    const auto edit = edit_of(edits.size() + 1, row.text(1));
    if (edit == nullptr) return damaged("an edit");
    if (hash == last_hash) {
      edit->marks = edits.back()->marks;
    } else {
      if (row.is_null(4) || sha256_hex(row.content(4)) != hash) return damaged("the painting of an edit");
      edit->marks = shared_marks(row.content(4));
    }
    if (edit->marks == nullptr) return damaged("the painting of an edit");
    last_hash = hash;
    edits.push_back(edit);
  }
  return edits;
}

}  // namespace

class Archive::Keeper : public SessionKeeper {
 public:
  Keeper(Database& database, std::string id) : database_(database), id_(std::move(id)) {}

  Outcome<Done> keep(const Document& before, const Document& after, const KeptAnswer* answer) override {
    const std::size_t known = common_start(before.edits, after.edits);
    const std::vector<EditRow> edits = new_edits(*after.edits, known);
    std::vector<std::byte> runs;
    std::string marks_seal;
    const bool repainted = before.marks != after.marks;
    if (repainted) {
      runs = encode_marks(*after.marks);
      marks_seal = sha256_hex(runs);
    }
    const std::string seal = session_seal(id_, after);
    const auto now = std::chrono::duration_cast<std::chrono::milliseconds>(
                         std::chrono::system_clock::now().time_since_epoch())
                         .count();
    return database_.change([&](Database::Access& access) -> Outcome<Done> {
      const auto rows = access.run(
          "UPDATE sessions SET revision = ?, head = ?, samples = ?, used = ?, seal = ? WHERE id = ?",
          static_cast<std::int64_t>(after.revision), static_cast<std::int64_t>(after.head),
          static_cast<std::int64_t>(after.surface.samples->size()), static_cast<std::int64_t>(now), seal,
          id_);
      if (rows != 1) return Problem{.kind = ProblemKind::kNotFound, .detail = "the session was deleted"};
      if (before.name != after.name) rename(access, after.name);
      if (repainted)
        access.run("INSERT OR REPLACE INTO session_marks (session, runs, seal) VALUES (?, ?, ?)", id_,
                   std::span<const std::byte>(runs), marks_seal);
      write_painting(access, kOperations, id_, static_cast<std::int64_t>(RegionKind::kZero), before.zero,
                     after.zero);
      write_painting(access, kOperations, id_, static_cast<std::int64_t>(RegionKind::kOne), before.one,
                     after.one);
      write_regions(access, id_, before.named, after.named);
      if (before.edits != nullptr && known < before.edits->size())
        access.run("DELETE FROM edits WHERE session = ? AND number > ?", id_,
                   static_cast<std::int64_t>(known));
      for (const EditRow& edit : edits) {
        if (!edit.runs.empty())
          access.run("INSERT OR IGNORE INTO paintings (session, hash, runs) VALUES (?, ?, ?)", id_,
                     edit.marks, std::span<const std::byte>(edit.runs));
        access.run("INSERT INTO edits (session, number, record, marks, seal) VALUES (?, ?, ?, ?, ?)", id_,
                   edit.number, edit.record, edit.marks,
                   row_seal({id_, std::to_string(edit.number), edit.record, edit.marks}));
      }
      // Paintings of edits that were undone and replaced.
      if (before.edits != nullptr && known < before.edits->size())
        access.run(
            "DELETE FROM paintings WHERE session = ? AND NOT EXISTS (SELECT 1 FROM edits WHERE edits.session "
            "= "
            "paintings.session AND edits.marks = paintings.hash)",
            id_);
      if (answer != nullptr) Answers::put(access, *answer);
      return Done{};
    });
  }

  void give_up(const std::string& reason) override {
    // Where even that cannot be written, the next start finds it once more.
    (void)database_.change([&](Database::Access& access) -> Outcome<Done> {
      access.run("UPDATE sessions SET damage = ? WHERE id = ?", reason, id_);
      return Done{};
    });
  }

 private:
  void rename(Database::Access& access, const std::string& name) const {
    JsonDocument params;
    std::string seal;
    {
      Statement row = access.query("SELECT owner, cloud, params FROM sessions WHERE id = ?", id_);
      if (!row.step()) return;
      params = JsonDocument::parse(row.text(2));
      params["name"] = name;
      seal = row_seal({id_, row.text(0), row.text(1), protocol::to_text(params)});
    }
    access.run("UPDATE sessions SET params = ?, params_seal = ? WHERE id = ?", protocol::to_text(params),
               seal, id_);
  }

  Database& database_;
  const std::string id_;
};

std::shared_ptr<SessionKeeper> Archive::keeper(const std::string& session) {
  return std::make_shared<Keeper>(database_, session);
}

Outcome<std::shared_ptr<const Document>> Archive::load(const std::string& session) {
  using Loaded = Outcome<std::shared_ptr<const Document>>;
  try {
    return database_.read([&](Database::Access& access) -> Loaded {
      auto document = std::make_shared<Document>();
      std::string seal;
      {
        Statement row = access.query("SELECT revision, head, seal FROM sessions WHERE id = ?", session);
        if (!row.step()) return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such session"};
        document->revision = static_cast<std::uint64_t>(row.integer(0));
        document->head = static_cast<std::size_t>(row.integer(1));
        seal = row.text(2);
      }
      {
        Statement row = access.query("SELECT runs, seal FROM session_marks WHERE session = ?", session);
        if (row.step()) {
          if (sha256_hex(row.content(0)) != row.text(1)) return damaged("its painting");
          document->marks = shared_marks(row.content(0));
          if (document->marks == nullptr) return damaged("its painting");
        }
      }
      auto zero = read_painting(access, kOperations, session, static_cast<std::int64_t>(RegionKind::kZero));
      if (!zero.ok()) return zero.problem();
      auto one = read_painting(access, kOperations, session, static_cast<std::int64_t>(RegionKind::kOne));
      if (!one.ok()) return one.problem();
      auto named = read_regions(access, session);
      if (!named.ok()) return named.problem();
      auto edits = read_edits(access, session);
      if (!edits.ok()) return edits.problem();
      document->zero = std::move(zero.value());
      document->one = std::move(one.value());
      document->named = std::move(named.value());
      document->edits = std::make_shared<const EditList>(std::move(edits.value()));
      if (seal != session_seal(session, *document) || document->head > document->edits->size())
        return damaged("its revision");
      return std::shared_ptr<const Document>(std::move(document));
    });
  } catch (const DatabaseError& error) {
    if ((error.code() & 0xff) != SQLITE_CORRUPT)
      return Problem{.kind = ProblemKind::kStorageFailed, .detail = "the database cannot be read now"};
    return damaged("the database");
  } catch (const Json::exception&) {
    return damaged("a row");
  }
}

}  // namespace pointwright::server
