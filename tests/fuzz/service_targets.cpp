#include <algorithm>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/handlers/query.h"
#include "server/http/head.h"
#include "server/ingest/exchange_record.h"
#include "server/store/marks_code.h"
#include "tests/fuzz/targets.h"

namespace pointwright::fuzz {
namespace {

using namespace server;

void promise(bool kept, const char* what) {
  if (!kept) throw std::logic_error(std::string("broken promise: ") + what);
}

bool is_clean(std::string_view text) {
  return std::none_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; });
}

}  // namespace

void try_head(std::span<const std::byte> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const HeadLimits limits;
  const auto parsed = parse_head(text, limits);
  if (const auto* problem = std::get_if<Problem>(&parsed)) {
    promise(problem->status() >= 400 && problem->status() < 600, "a refusal has a status");
    return;
  }
  const auto& head = std::get<RequestHead>(parsed);
  promise(head.path.size() <= limits.max_path_bytes && head.headers.size() <= limits.max_headers,
          "limits are kept");
  promise(head.path.starts_with('/') && is_clean(head.path),
          "a path is absolute and without control characters");
  for (const auto& [name, value] : head.headers)
    promise(!name.empty() && is_clean(name) && value.find_first_of("\r\n") == std::string::npos &&
                value.find('\0') == std::string::npos,
            "fields end where their lines end");
  promise(head.header("host").has_value(), "every request says where it goes");
  static_cast<void>(check_origin(head, {"example.org"}, {"https://example.org"}));
  static_cast<void>(check_query(head, "level attributes"));
  static_cast<void>(query_list(head, "attributes"));
  static_cast<void>(query_number(head, "level"));
  static_cast<void>(query_fraction(head, "s"));
  const auto format = negotiated_format(head, {{"ply", "model/ply", "ply"}, {"draco", "model/draco", "drc"}});
  promise(!format.ok() || !format.value().name.empty(), "a format has a name");
  for (const auto& [name, value] : head.query)
    promise(is_clean(download_name(value, "ply")), "a file's name has no control characters");
}

void try_answer(std::span<const std::byte> bytes) {
  if (const auto cloud = read_answer(bytes); !cloud.ok())
    promise(!cloud.error().message.empty(), "an error says something");
  if (const auto image = read_image_answer(bytes); image.ok())
    promise(is_valid(image.value()), "an image that was taken is valid");
}

void try_marks(std::span<const std::byte> bytes) {
  constexpr std::uint64_t kMost = 1'000'000;
  const auto marks = decode_marks(bytes, kMost);
  if (!marks) return;
  promise(marks->size() <= kMost, "limits are kept");
  const auto again = encode_marks(*marks);
  promise(again.size() <= bytes.size(), "encoding is as short as can be");
  promise(decode_marks(again, kMost) == marks, "marks come back");
}

}  // namespace pointwright::fuzz
