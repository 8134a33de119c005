#include "server/jobs/unpacked_scan.h"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/io/decoded_cloud.h"
#include "engine/io/draco_tiles.h"
#include "engine/io/ply.h"
#include "server/base/descriptor.h"
#include "server/ingest/confined.h"
#include "server/ingest/files.h"
#include "server/jobs/raw_bytes.h"
#include "server/jobs/scan_source.h"

namespace pointwright::server {
namespace {

using protocol::Problem;
using protocol::ProblemKind;

constexpr std::uint64_t kTextPiece = std::uint64_t{1} << 22U;  // bytes that are read together
constexpr std::size_t kPiecesAtOnce = 2;
constexpr std::uint64_t kMostSamples = std::uint64_t{1}
                                       << 40U;  // whose bytes can be counted, whatever they hold
/// Of a tile's sample while it is decoded: the decoder's, columns twice, the row.
constexpr std::uint64_t kBytesOfTileSample = 300;
/// No tile is refused for less.
constexpr std::uint64_t kUsualMemory = std::uint64_t{128} << 20U;

/// Rows of the unpacked scan.
struct Rows {
  std::uint64_t first = 0;
  std::vector<std::byte> bytes;
};

std::uint64_t row_bytes(std::span<const PlyProperty> properties) {
  std::uint64_t bytes = 0;
  for (const PlyProperty& property : properties) bytes += size_of(property.type);
  return bytes;
}

/// The columns as rows of binary PLY, column places[k] in the k-th place. An empty list: in their order.
std::vector<std::byte> rows_of(std::span<const ScalarAttribute> columns, std::span<const std::size_t> places,
                               std::uint64_t bytes_each) {
  const std::size_t count = columns.front().size();
  std::vector<std::byte> rows(count * static_cast<std::size_t>(bytes_each));
  std::byte* to = rows.data();
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const ScalarAttribute& column = columns[places.empty() ? k : places[k]];
    std::visit(
        [&](const auto& values) {
          std::byte* at = to;
          for (const auto& value : values) {
            std::memcpy(at, &value, sizeof value);
            at += bytes_each;
          }
          to += sizeof values.front();
        },
        column.values);
  }
  return rows;
}

/// A scan as pieces, in any order.
class Pieces {
 public:
  virtual ~Pieces() = default;
  [[nodiscard]] virtual const std::vector<PlyProperty>& properties() const = 0;
  [[nodiscard]] virtual std::size_t count() const = 0;
  /// The rows of a piece that this process has to do; nullopt: there are none left. Any thread. `piece`: its
  /// place among them, also where there is an error.
  virtual Result<std::optional<Rows>> next(const Team& team, std::size_t& piece) = 0;
  [[nodiscard]] virtual std::size_t at_once() const { return kPiecesAtOnce; }
};

/// Lines of text: cut at their ends, their rows counted first.
class TextPieces final : public Pieces {
 public:
  /// Done by all of a team.
  static Outcome<std::unique_ptr<Pieces>> of(const MappedFile& file, Team& team,
                                             const ExecutionContext& context) {
    auto header = parse_ply_header(file.bytes());
    if (!header) return protocol::to_problem(header.error());
    std::unique_ptr<TextPieces> pieces(new TextPieces(file, std::move(header).value()));
    pieces->cut();
    pieces->count_rows(team);
    if (context.is_cancelled()) return protocol::to_problem(cancelled_error());
    if (auto wrong = pieces->check_rows()) return protocol::to_problem(*wrong);
    return std::unique_ptr<Pieces>(std::move(pieces));
  }

  [[nodiscard]] const std::vector<PlyProperty>& properties() const override { return properties_; }
  [[nodiscard]] std::size_t count() const override { return pieces_.size(); }
  Result<std::optional<Rows>> next(const Team& team, std::size_t& place) override {
    std::size_t k = next_++;
    while (k < pieces_.size() && !team.takes(k)) k = next_++;
    place = k;
    if (k >= pieces_.size()) return std::optional<Rows>();
    const Piece& piece = pieces_[k];
    const std::uint64_t count = header_.vertex()->count;
    Rows rows{.first = piece.first_row, .bytes = {}};
    if (piece.first_row >= count) return std::optional(std::move(rows));
    const std::uint64_t here = std::min(piece.count.rows, count - piece.first_row);
    const auto columns = read_ply_rows(text_of_piece(piece), header_, here, piece.first_line);
    file_.release(piece.begin, piece.end);
    if (!columns) return columns.error();
    rows.bytes = rows_of(columns.value(), {}, row_bytes(properties_));
    return std::optional(std::move(rows));
  }

 private:
  struct Piece {
    std::uint64_t begin = 0;  // bytes
    std::uint64_t end = 0;
    PlyRowCount count;
    std::uint64_t first_row = 0;
    std::uint64_t first_line = 0;
  };

  TextPieces(const MappedFile& file, PlyHeader header) : file_(file), header_(std::move(header)) {
    for (const PlyProperty& property : header_.vertex()->properties)
      if (!property.is_list) properties_.push_back(property);
  }

  [[nodiscard]] std::string_view text_of_piece(const Piece& piece) const {
    return {reinterpret_cast<const char*>(file_.bytes().data()) + piece.begin,
            static_cast<std::size_t>(piece.end - piece.begin)};
  }

  void cut() {
    const std::uint64_t size = file_.bytes().size();
    pieces_.reserve(static_cast<std::size_t>(size / kTextPiece) + 1);
    for (std::uint64_t begin = header_.data_offset; begin < size;) {
      std::uint64_t end = std::min(size, begin + kTextPiece);
      if (end < size) {
        const std::byte* const from = file_.bytes().data() + end;
        const void* const line_end =
            std::memchr(from, header_.line_end, static_cast<std::size_t>(size - end));
        end = line_end == nullptr
                  ? size
                  : end + static_cast<std::uint64_t>(static_cast<const std::byte*>(line_end) - from) + 1;
      }
      pieces_.push_back({.begin = begin, .end = end});
      begin = end;
    }
  }

  void count_rows(Team& team) {
    std::vector<std::size_t> mine;
    for (std::size_t k = 0; k < pieces_.size(); ++k)
      if (team.takes(k)) mine.push_back(k);
    parallel_for(
        mine.size(),
        [&](std::size_t begin, std::size_t end) {
          for (std::size_t m = begin; m < end; ++m) {
            Piece& piece = pieces_[mine[m]];
            piece.count = count_ply_rows(text_of_piece(piece), header_.line_end);
            file_.release(piece.begin, piece.end);
          }
        },
        1);
    std::vector<PlyRowCount> counts;
    counts.reserve(mine.size());
    for (const std::size_t k : mine) counts.push_back(pieces_[k].count);
    const auto told = team.gather(std::as_bytes(std::span(counts)));
    // In turns, as they were taken.
    std::vector<std::span<const std::byte>> rest(told.begin(), told.end());
    std::uint64_t row = 0;
    std::uint64_t line = header_.line_count + 1;
    for (std::size_t k = 0; k < pieces_.size(); ++k) {
      Piece& piece = pieces_[k];
      take_raw(rest[k % rest.size()], &piece.count, 1);
      piece.first_row = std::exchange(row, row + piece.count.rows);
      piece.first_line = std::exchange(line, line + piece.count.lines);
    }
    rows_ = row;
  }

  /// Rows of all elements stand in lines of their own.
  [[nodiscard]] std::optional<Error> check_rows() const {
    std::uint64_t owed = 0;
    for (const PlyElement& element : header_.elements) {
      if (element.properties.empty()) continue;
      if (element.count > rows_ - std::min(rows_, owed))
        return Error{.code = ErrorCode::kMalformedData,
                     .message = "the file ends before all " + std::to_string(element.count) +
                                " rows of element " + pointwright::quoted(element.name),
                     .field = clean_name(element.name)};
      owed += element.count;
    }
    if (owed == rows_) return std::nullopt;
    return Error{
        .code = ErrorCode::kMalformedData,
        .message = "the file has " + std::to_string(rows_ - owed) + " more rows than its header describes",
        .field = "header"};
  }

  const MappedFile& file_;
  const PlyHeader header_;
  std::vector<PlyProperty> properties_;
  std::vector<Piece> pieces_;
  std::uint64_t rows_ = 0;
  std::atomic<std::size_t> next_{0};
};

/// An archive's tiles, by the attributes of its first one.
class TilePieces final : public Pieces {
 public:
  static Outcome<std::unique_ptr<Pieces>> of(const JobParams& params, const MappedFile& file) {
    auto reader = DracoTilesReader::open(file.bytes(), kMostSamples);
    if (!reader) return protocol::to_problem(reader.error());
    std::unique_ptr<TilePieces> pieces(new TilePieces(params, file, std::move(reader).value()));
    auto first = DracoTilesReader::open(file.bytes(), kMostSamples);
    if (!first) return protocol::to_problem(first.error());
    while (true) {
      auto piece = first.value().next();
      if (!piece) return protocol::to_problem(piece.error());
      if (!piece.value() || piece.value()->tile != 0) continue;
      const auto columns = pieces->columns_of(*piece.value());
      if (!columns) return protocol::to_problem(columns.error());
      pieces->set_layout(columns.value());
      return std::unique_ptr<Pieces>(std::move(pieces));
    }
  }

  [[nodiscard]] const std::vector<PlyProperty>& properties() const override { return properties_; }
  [[nodiscard]] std::size_t count() const override { return reader_.tiles().size(); }
  [[nodiscard]] std::size_t at_once() const override {
    const std::uint64_t largest =
        std::ranges::max(reader_.tiles(), {}, &DracoTile::sample_count).sample_count;
    const std::uint64_t memory = std::max(params_.memory_bytes, kUsualMemory);
    return kPiecesAtOnce * kBytesOfTileSample * largest <= memory ? kPiecesAtOnce : 1;
  }
  Result<std::optional<Rows>> next(const Team& team, std::size_t& place) override {
    std::optional<DracoTilesReader::Piece> piece;
    {
      const std::lock_guard lock(mutex_);
      place = taken_++;
      do {
        auto taken = reader_.next();
        if (!taken) return taken.error();
        piece = std::move(taken).value();
        file_.release(0, file_.bytes().size());
      } while (piece && !team.takes(piece->tile));
    }
    if (!piece) return std::optional<Rows>();
    const auto columns = columns_of(*piece);
    if (!columns) return columns.error();
    const auto places = match_columns(layout_, columns.value(), reader_.tiles()[piece->tile]);
    if (!places) return places.error();
    return std::optional(Rows{.first = first_[piece->tile],
                              .bytes = rows_of(columns.value(), places.value(), row_bytes(properties_))});
  }

 private:
  TilePieces(const JobParams& params, const MappedFile& file, DracoTilesReader reader)
      : params_(params), file_(file), reader_(std::move(reader)) {
    std::uint64_t row = 0;
    first_.reserve(reader_.tiles().size());
    for (const DracoTile& tile : reader_.tiles())
      first_.push_back(std::exchange(row, row + tile.sample_count));
  }

  Result<std::vector<ScalarAttribute>> columns_of(const DracoTilesReader::Piece& piece) const {
    const DracoTile& tile = reader_.tiles()[piece.tile];
    const ImportParams import{.max_samples = tile.sample_count};
    const auto decoded = params_.confined ? decode_confined(piece.bytes, CloudFormat::kDraco, import,
                                                            confinement(params_, piece.bytes.size()))
                                          : decode_cloud(piece.bytes, CloudFormat::kDraco, import);
    if (!decoded) return in_tile(decoded.error(), tile);
    return tile_columns(decoded.value().cloud, tile);
  }

  void set_layout(const std::vector<ScalarAttribute>& columns) {
    for (const ScalarAttribute& column : columns) {
      properties_.push_back({.name = column.name, .type = type_of(column)});
      layout_.push_back({.name = column.name, .values = make_values(type_of(column))});
    }
  }

  const JobParams& params_;
  const MappedFile& file_;
  std::mutex mutex_;  // guards the reader and the count
  DracoTilesReader reader_;
  std::size_t taken_ = 0;
  std::vector<std::uint64_t> first_;  // rows before each tile
  std::vector<PlyProperty> properties_;
  std::vector<ScalarAttribute> layout_;  // without values
};

std::optional<Problem> check_room(const std::string& to, std::uint64_t bytes) {
  struct statvfs room {};
  const std::string folder = std::filesystem::path(to).parent_path().string();
  if (::statvfs(folder.c_str(), &room) != 0) return std::nullopt;  // then writing says why
  // What an interrupted job has left of it makes room.
  std::error_code none;
  const std::uint64_t there = std::filesystem::file_size(to, none);
  const std::uint64_t free =
      static_cast<std::uint64_t>(room.f_bavail) * room.f_frsize + (none ? std::uint64_t{0} : there);
  if (free >= bytes) return std::nullopt;
  return Problem{.kind = ProblemKind::kOutOfDisk,
                 .detail = "the scan takes " + std::to_string(bytes >> 20U) + " MiB once it is unpacked",
                 .limit = static_cast<double>(free),
                 .actual = static_cast<double>(bytes)};
}

std::optional<Problem> create(const std::string& path) {
  const Descriptor made(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (made.is_open()) return std::nullopt;
  return protocol::to_problem(file_error("cannot write", path, errno));
}

/// Each writes its pieces. Collective calls are the caller's.
std::optional<Problem> write_pieces(Pieces& pieces, SharedFile& out, std::uint64_t head,
                                    const std::string& to, const Team& team, const ExecutionContext& context,
                                    const JobProgress& progress) {
  std::optional<Problem> problem;
  std::size_t failed = 0;  // the first piece that did: the same for any number of threads
  std::size_t done = 0;
  std::mutex mutex;  // guards these and the progress
  const std::uint64_t bytes_each = row_bytes(pieces.properties());
  const auto fail = [&](std::size_t piece, const Error& error) {
    const std::lock_guard lock(mutex);
    if (problem && failed <= piece) return;
    problem = protocol::to_problem(error);
    failed = piece;
  };
  parallel_for(
      pieces.at_once(),
      [&](std::size_t, std::size_t) {
        while (true) {
          {
            const std::lock_guard lock(mutex);
            if (problem) return;
          }
          if (context.is_cancelled()) return fail(0, cancelled_error());
          std::size_t piece = 0;
          const auto rows = pieces.next(team, piece);
          if (!rows) return fail(piece, rows.error());
          if (!rows.value()) return;
          if (!out.write_at(rows.value()->bytes, head + rows.value()->first * bytes_each))
            return fail(piece, file_error("cannot write", to, errno));
          const std::lock_guard lock(mutex);
          done += static_cast<std::size_t>(team.size());
          progress("unpacking",
                   std::min(1.0, static_cast<double>(done) / static_cast<double>(pieces.count())));
        }
      },
      1);
  return problem;
}

}  // namespace

std::uint64_t PackedScan::least_memory() const {
  const std::uint64_t needed = kBytesOfTileSample * most_of_tile;
  return needed <= kUsualMemory ? 0 : needed;
}

Result<std::optional<PackedScan>> packed_scan(const MappedFile& file) {
  constexpr std::size_t kStart = std::size_t{1} << 16U;  // enough to know these two by
  const auto format = detect_format(file.bytes().first(std::min(file.bytes().size(), kStart)));
  if (!format) return format.error();
  if (format.value() == CloudFormat::kDracoTiles) {
    const auto reader = DracoTilesReader::open(file.bytes(), kMostSamples);
    if (!reader) return reader.error();
    return std::optional(PackedScan{
        .packing = Packing::kDracoTiles,
        .samples = reader.value().sample_count(),
        .record_bytes = std::nullopt,
        .most_of_tile = std::ranges::max(reader.value().tiles(), {}, &DracoTile::sample_count).sample_count});
  }
  if (format.value() != CloudFormat::kPly) return std::optional<PackedScan>();
  const auto header = parse_ply_header(file.bytes());
  if (!header) return header.error();
  const PlyElement* const vertex = header.value().vertex();
  if (header.value().encoding != PlyEncoding::kAscii || vertex == nullptr || vertex->count == 0 ||
      vertex != header.value().elements.data() || vertex->count > kMostSamples)
    return std::optional<PackedScan>();
  std::uint64_t bytes = 0;
  std::size_t coordinates = 0;
  for (const PlyProperty& property : vertex->properties) {
    if (property.is_list) continue;
    bytes += size_of(property.type);
    const bool is_place = property.name == "x" || property.name == "y" || property.name == "z";
    if (is_place && (property.type == ScalarType::kFloat || property.type == ScalarType::kDouble))
      ++coordinates;
  }
  if (coordinates != 3) return std::optional<PackedScan>();
  return std::optional(
      PackedScan{.packing = Packing::kTextPly, .samples = vertex->count, .record_bytes = bytes});
}

std::optional<Problem> unpack_scan(const JobParams& params, const MappedFile& file, const PackedScan& scan,
                                   const std::string& to, Team& team, const ExecutionContext& context,
                                   const JobProgress& progress) {
  progress("unpacking", 0.0);
  auto pieces =
      scan.packing == Packing::kTextPly ? TextPieces::of(file, team, context) : TilePieces::of(params, file);
  if (auto any = team.agree(pieces.ok() ? std::nullopt : std::optional(pieces.problem()))) return any;
  const std::string head = ply_header_text(scan.samples, pieces.value()->properties());
  std::optional<Problem> problem;
  if (team.leads())
    problem = check_room(to, head.size() + scan.samples * row_bytes(pieces.value()->properties()));
  if (team.leads() && !problem) problem = create(to);
  if (auto any = team.agree(problem)) return any;
  const auto out = team.open(to);
  if (out == nullptr) problem = protocol::to_problem(file_error("cannot write", to, errno));
  if (auto any = team.agree(problem)) return any;
  problem = write_pieces(*pieces.value(), *out, head.size(), to, team, context, progress);
  const auto head_bytes = std::as_bytes(std::span(head.data(), head.size()));
  const bool has_head = !team.leads() || out->write_at(head_bytes, 0);
  if (!problem && !has_head) problem = protocol::to_problem(file_error("cannot write", to, errno));
  // By all of them, whoever has failed.
  if (!out->sync() && !problem) problem = protocol::to_problem(file_error("cannot write", to, errno));
  return team.agree(problem);
}

}  // namespace pointwright::server
