#include "server/ingest/exchange_record.h"

#include <cmath>
#include <cstring>

#include "engine/io/cloud_blob.h"
#include "engine/io/text.h"

namespace pointwright {
namespace {

constexpr std::size_t kLongestText = 1024;

struct ErrorHead {
  AnswerKind kind = AnswerKind::kError;
  std::uint32_t code = 0;
  std::uint32_t has_numbers = 0;  // bit 0: limit, bit 1: actual
  double limit = 0.0;
  double actual = 0.0;
  std::uint64_t message_bytes = 0;
  std::uint64_t field_bytes = 0;
};

Error unreadable() {
  return Error{.code = ErrorCode::kMalformedData,
               .message = "the decoder could make nothing of the file",
               .field = {}};
}

AnswerKind kind_of(std::span<const std::byte> answer) {
  auto kind = AnswerKind::kNone;
  if (answer.size() >= sizeof(kind)) std::memcpy(&kind, answer.data(), sizeof(kind));
  return kind;
}

// The error that the answer holds, or that it is none.
Error read_error(std::span<const std::byte> answer) {
  ErrorHead head;
  if (kind_of(answer) != AnswerKind::kError || answer.size() < sizeof(head)) return unreadable();
  std::memcpy(&head, answer.data(), sizeof(head));
  const std::size_t rest = answer.size() - sizeof(head);
  const bool sizes_fit = head.message_bytes <= kLongestText && head.field_bytes <= kLongestText &&
                         head.message_bytes + head.field_bytes == rest;
  if (!sizes_fit || head.message_bytes == 0 || head.code > static_cast<std::uint32_t>(ErrorCode::kCancelled))
    return unreadable();
  const auto* text = reinterpret_cast<const char*>(answer.data()) + sizeof(head);
  Error error{.code = static_cast<ErrorCode>(head.code),
              .message = clean_text({text, head.message_bytes}),
              .field = clean_text({text + head.message_bytes, head.field_bytes})};
  if ((head.has_numbers & 1U) != 0 && std::isfinite(head.limit)) error.limit = head.limit;
  if ((head.has_numbers & 2U) != 0 && std::isfinite(head.actual)) error.actual = head.actual;
  return error;
}

}  // namespace

std::vector<std::byte> error_answer(const Error& error) {
  const std::string message = error.message.substr(0, kLongestText);
  const std::string field = error.field.substr(0, kLongestText);
  ErrorHead head;
  head.code = static_cast<std::uint32_t>(error.code);
  head.has_numbers = (error.limit ? 1U : 0U) | (error.actual ? 2U : 0U);
  head.limit = error.limit.value_or(0.0);
  head.actual = error.actual.value_or(0.0);
  head.message_bytes = message.size();
  head.field_bytes = field.size();
  std::vector<std::byte> answer(sizeof(head) + message.size() + field.size());
  std::memcpy(answer.data(), &head, sizeof(head));
  std::memcpy(answer.data() + sizeof(head), message.data(), message.size());
  std::memcpy(answer.data() + sizeof(head) + message.size(), field.data(), field.size());
  return answer;
}

Result<ImportedCloud> read_answer(std::span<const std::byte> answer) {
  if (kind_of(answer) == AnswerKind::kCloud) return read_cloud_blob(answer.subspan(sizeof(AnswerKind)));
  return read_error(answer);
}

Result<Image> read_image_answer(std::span<const std::byte> answer) {
  ImageHead head;
  if (kind_of(answer) != AnswerKind::kImage) return read_error(answer);
  if (answer.size() < sizeof(head)) return unreadable();
  std::memcpy(&head, answer.data(), sizeof(head));
  Image image{.width = head.width,
              .height = head.height,
              .channels = head.channels,
              .bytes_per_value = head.bytes_per_value,
              .values = {}};
  const std::span<const std::byte> values = answer.subspan(sizeof(head));
  image.values.assign(values.begin(), values.end());
  if (!is_valid(image)) return unreadable();
  return image;
}

}  // namespace pointwright
