#include "server/store/image_store.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "server/base/random_id.h"
#include "server/ingest/confined.h"
#include "server/store/sha256.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

std::vector<std::string> channels_of(const Image& image) {
  std::vector<std::string> names;
  if (image.has_colors()) {
    names = {"red", "green", "blue"};
  } else {
    names = {"grey"};
  }
  if (image.has_alpha()) names.emplace_back("alpha");
  return names;
}

auto has_id(const std::string& id) {
  return [&id](const SharedImage& image) { return image->document.id == id; };
}

ImageLimits image_limits(const Limits& limits) {
  return {.max_side = limits.max_image_side, .max_pixels = limits.max_image_pixels};
}

}  // namespace

ImageDecoder confined_image_decoder(const Limits& limits, std::shared_ptr<DecodeSlots> slots) {
  return [claims = image_limits(limits), slots = std::move(slots)](std::span<const std::byte> bytes) {
    ConfineLimits confine;
    confine.slots = slots.get();
    return decode_image_confined(bytes, claims, confine);
  };
}

ImageStore::ImageStore(const Limits& limits)
    : max_images_(limits.max_images), limits_(image_limits(limits)), memory_(limits.max_image_bytes) {}

Outcome<Done> ImageStore::check_room_locked() const {
  if (images_.size() < max_images_) return Done{};
  return Problem{.kind = ProblemKind::kTooMany,
                 .detail = "the server holds as many images as it may",
                 .limit = static_cast<double>(max_images_),
                 .actual = static_cast<double>(images_.size())};
}

Outcome<Done> ImageStore::check_room() const {
  const std::lock_guard lock(mutex_);
  return check_room_locked();
}

Outcome<SharedImage> ImageStore::add(const ImageDecoder& decode, std::span<const std::byte> file) {
  if (file.empty()) return Problem{.kind = ProblemKind::kEmptyBody, .detail = "the upload has no bytes"};
  // What the header claims is reserved before anything is decoded.
  const auto claim = png_gate(file, limits_);
  if (!claim) return protocol::to_problem(claim.error());
  const std::uint64_t claimed = claim.value().value_bytes + file.size();
  auto stored = std::make_shared<StoredImage>();
  stored->memory = memory_.hold(claimed);
  if (stored->memory == nullptr)
    return Problem{.kind = ProblemKind::kOutOfSpace,
                   .detail = "the memory for images is used up",
                   .limit = static_cast<double>(memory_.total()),
                   .actual = static_cast<double>(memory_.held() + claimed)};
  auto decoded = decode(file);
  if (!decoded) {
    if (decoded.error().field == "decoder")
      return Problem{.kind = ProblemKind::kOverloaded, .detail = decoded.error().message};
    return protocol::to_problem(decoded.error());
  }
  stored->memory->shrink_to(value_bytes(decoded.value()) + file.size());
  auto image = std::make_shared<const Image>(std::move(decoded).value());
  stored->document = {.id = random_id(),
                      .width = image->width,
                      .height = image->height,
                      .channels = channels_of(*image),
                      .bytes = file.size(),
                      .created = std::chrono::system_clock::now()};
  stored->sha256 = sha256_hex(file);
  stored->file.assign(reinterpret_cast<const char*>(file.data()), file.size());
  stored->image = std::move(image);
  const std::lock_guard lock(mutex_);
  if (auto room = check_room_locked(); !room.ok()) return room.problem();
  images_.push_back(stored);
  return SharedImage(stored);
}

SharedImage ImageStore::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(images_.begin(), images_.end(), has_id(id));
  return it == images_.end() ? nullptr : *it;
}

std::vector<SharedImage> ImageStore::list() const {
  const std::lock_guard lock(mutex_);
  return images_;
}

Outcome<Done> ImageStore::remove(const std::string& id) {
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(images_.begin(), images_.end(), has_id(id));
  if (it == images_.end()) return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such image"};
  images_.erase(it);
  return Done{};
}

}  // namespace pointwright::server
