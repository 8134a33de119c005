#include "server/ingest/confined.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>

#include "server/ingest/child_process.h"
#include "server/ingest/exchange_record.h"
#include "server/ingest/files.h"

namespace pointwright {
namespace {

Error decoder_error(std::string message) {
  return Error{.code = ErrorCode::kCancelled, .message = std::move(message), .field = "decoder"};
}

Error too_large(std::string message) {
  return Error{.code = ErrorCode::kTooLarge, .message = std::move(message), .field = {}};
}

Descriptor memory_file(const char* name) {
  return Descriptor(memfd_create(name, MFD_CLOEXEC));
}

// A file's content in our address space while it lives.
class Mapping {
 public:
  explicit Mapping(const Descriptor& file) {
    struct stat info {};
    if (fstat(file.get(), &info) != 0 || info.st_size <= 0) return;
    size_ = static_cast<std::size_t>(info.st_size);
    void* mapped = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file.get(), 0);
    if (mapped != MAP_FAILED) data_ = static_cast<const std::byte*>(mapped);
  }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  ~Mapping() {
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): munmap takes what mmap gave.
    if (data_ != nullptr) munmap(const_cast<std::byte*>(data_), size_);
  }
  [[nodiscard]] std::span<const std::byte> bytes() const {
    return data_ == nullptr ? std::span<const std::byte>() : std::span(data_, size_);
  }

 private:
  const std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

// Why a decoder that gave no answer gave none.
Error failure(const ChildEnd& end, const ConfineLimits& limits) {
  const std::string seconds = std::to_string(static_cast<long>(std::ceil(limits.deadline_seconds)));
  if (end.by_cancel) return cancelled_error();
  if (end.by_deadline || end.signal == SIGXCPU) {
    Error error = too_large("decoding the file takes longer than " + seconds + " s");
    error.limit = limits.deadline_seconds;
    return error;
  }
  switch (end.signal) {
    case 0:
      return end.status == 4 ? too_large("what the file decodes to is larger than a decoder may write")
                             : decoder_error("the decoder could not be confined, so the file was not read");
    case SIGXFSZ:
      return too_large("what the file decodes to is larger than a decoder may write");
    case SIGKILL:
      return too_large("decoding the file takes more memory than there is");
    default:
      break;
  }
  return Error{.code = ErrorCode::kMalformedData,
               .message = "the file stops the decoder (signal " + std::to_string(end.signal) + ")",
               .field = {}};
}

// The bytes to decode: a file of ours, or what is in memory and must be written to one.
struct Input {
  int file = -1;
  std::span<const std::byte> bytes = {};
  std::uint64_t byte_count = 0;
};
Input input_of(std::span<const std::byte> bytes) {
  return {.bytes = bytes, .byte_count = bytes.size()};
}

// Adds what every request says.
DecodeRequest with_limits(DecodeRequest request, const Input& input, const ConfineLimits& limits) {
  request.byte_count = input.byte_count;
  request.memory_bytes = limits.memory_bytes;
  request.cpu_seconds = static_cast<std::uint64_t>(std::ceil(std::max(1.0, limits.deadline_seconds)));
  return request;
}

// Starts a decoder, waits for its end and hands its answer to `read`. Read: Result<T>(bytes of the answer).
template <typename Read>
auto decode_in_child(const DecodeRequest& request, const Input& input, const ConfineLimits& limits,
                     const ExecutionContext* context, const Read& read) -> decltype(read(input.bytes)) {
  if (input.byte_count == 0)
    return Error{.code = ErrorCode::kEmptyCloud, .message = "there are no bytes", .field = {}};
  DecodeSlots::Lease lease;
  if (limits.slots != nullptr) {
    lease = limits.slots->acquire(std::chrono::duration<double>(limits.queue_seconds));
    if (!lease) return decoder_error("every decoder is busy; none came free in time");
  }
  const Descriptor record = memory_file("pointwright-request");
  const Descriptor content = input.file < 0 ? memory_file("pointwright-upload") : Descriptor();
  const Descriptor output = memory_file("pointwright-answer");
  std::array<int, 2> ends{-1, -1};
  if (!record.is_open() || (input.file < 0 && !content.is_open()) || !output.is_open() ||
      pipe2(ends.data(), O_CLOEXEC) != 0) {
    return decoder_error("there are no descriptors left for a decoder");
  }
  const Descriptor alive(ends[0]);
  Descriptor held(ends[1]);
  if (!write_all(record.get(), std::as_bytes(std::span(&request, 1))) ||
      (input.file < 0 && !write_all(content.get(), input.bytes))) {
    return decoder_error("there is no memory left to hand the file to a decoder");
  }
  const auto child = start_child(
      {.program = limits.program,
       .arguments = {"pointwright-decoder", kDecodeChildArgument},
       .descriptors = {record.get(), output.get(), held.get(), input.file < 0 ? content.get() : input.file}});
  held.close();  // the child's copy alone keeps the pipe open
  if (!child) return decoder_error("no decoder could be started");
  const ChildEnd end =
      wait_for_child(*child, alive, std::chrono::duration<double>(limits.deadline_seconds), context);
  if (end.by_cancel || end.by_deadline || end.signal != 0 || end.status != 0) return failure(end, limits);
  // The child is gone: nobody but us holds the answer any more.
  const Mapping answer(output);
  return read(answer.bytes());
}

}  // namespace

namespace {

bool fits(const Image& image, const ImageLimits& limits) {
  return std::max(image.width, image.height) <= limits.max_side &&
         std::uint64_t{image.width} * image.height <= limits.max_pixels;
}

}  // namespace

namespace {

Result<ImportedCloud> decode_cloud_of(const Input& input, CloudFormat format, const ImportParams& params,
                                      const ConfineLimits& limits, const ExecutionContext* context) {
  DecodeRequest request;
  request.format = static_cast<std::uint64_t>(format);
  request.drop_non_finite = params.drop_non_finite ? 1 : 0;
  request.max_samples = params.max_samples;
  request = with_limits(request, input, limits);
  return decode_in_child(request, input, limits, context,
                         [&](std::span<const std::byte> answer) -> Result<ImportedCloud> {
                           auto decoded = read_answer(answer);
                           if (decoded && decoded.value().report.format != format)
                             return failure(ChildEnd{.signal = SIGSYS}, limits);
                           return decoded;
                         });
}

}  // namespace

Result<ImportedCloud> decode_confined(std::span<const std::byte> bytes, CloudFormat format,
                                      const ImportParams& params, const ConfineLimits& limits,
                                      const ExecutionContext* context) {
  return decode_cloud_of(input_of(bytes), format, params, limits, context);
}

Result<ImportedCloud> decode_confined(int file, std::uint64_t byte_count, CloudFormat format,
                                      const ImportParams& params, const ConfineLimits& limits,
                                      const ExecutionContext* context) {
  return decode_cloud_of({.file = file, .byte_count = byte_count}, format, params, limits, context);
}

Result<Image> decode_image_confined(std::span<const std::byte> bytes, const ImageLimits& image_limits,
                                    const ConfineLimits& limits, const ExecutionContext* context) {
  DecodeRequest request;
  request.subject = DecodeSubject::kImage;
  request.max_side = image_limits.max_side;
  request.max_pixels = image_limits.max_pixels;
  const Input input = input_of(bytes);
  request = with_limits(request, input, limits);
  return decode_in_child(request, input, limits, context,
                         [&](std::span<const std::byte> answer) -> Result<Image> {
                           auto image = read_image_answer(answer);
                           if (image && !fits(image.value(), image_limits))
                             return failure(ChildEnd{.signal = SIGSYS}, limits);
                           return image;
                         });
}

}  // namespace pointwright
