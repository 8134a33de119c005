#include "server/store/image_store.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "server/base/random_id.h"
#include "server/base/sha256.h"
#include "server/ingest/confined.h"

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

auto is_image(const std::string& id) {
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

ImageStore::ImageStore(const Limits& limits, Archive* archive)
    : limits_(image_limits(limits)),
      archive_(archive),
      memory_(limits.max_image_bytes),
      places_("images", limits.max_images) {}

void ImageStore::restore(std::vector<KeptImage> images) {
  const std::lock_guard lock(mutex_);
  for (KeptImage& kept : images) {
    auto stored = std::make_shared<StoredImage>();
    stored->document = std::move(kept.document);
    stored->sha256 = std::move(kept.sha256);
    stored->owner = std::move(kept.owner);
    stored->quota = std::move(kept.quota);
    images_.push_back(std::move(stored));
  }
}

Outcome<Done> ImageStore::check_room() const {
  const std::lock_guard lock(mutex_);
  return places_.check(images_.size());
}

Outcome<std::shared_ptr<const ImageContent>> ImageStore::decoded(const ImageDecoder& decode,
                                                                 std::span<const std::byte> file,
                                                                 const StoredImage* loading) const {
  // What the header claims is reserved before anything is decoded.
  const auto claim = png_gate(file, limits_);
  if (!claim) return protocol::to_problem(claim.error());
  const std::uint64_t claimed = claim.value().value_bytes + file.size();
  auto content = std::make_shared<ImageContent>();
  content->memory = room_for(claimed, loading);
  const bool may_pass = loading != nullptr && claimed <= memory_.total();
  if (content->memory == nullptr)
    return Problem{.kind = may_pass ? ProblemKind::kOverloaded : ProblemKind::kOutOfSpace,
                   .detail = "the memory for images is used up",
                   .limit = static_cast<double>(memory_.total()),
                   .actual = static_cast<double>(memory_.held() + claimed)};
  auto image = decode(file);
  if (!image) {
    if (image.error().field == "decoder")
      return Problem{.kind = ProblemKind::kOverloaded, .detail = image.error().message};
    return protocol::to_problem(image.error());
  }
  content->image = std::move(image).value();
  content->memory->shrink_to(value_bytes(content->image) + file.size());
  content->file.assign(reinterpret_cast<const char*>(file.data()), file.size());
  return std::shared_ptr<const ImageContent>(std::move(content));
}

std::shared_ptr<Budget::Hold> ImageStore::room_for(std::uint64_t bytes, const StoredImage* loading) const {
  auto memory = memory_.hold(bytes);
  if (memory != nullptr || archive_ == nullptr || bytes > memory_.total()) return memory;
  for (const SharedImage& image : list()) {
    if (image.get() == loading) continue;
    const std::unique_lock lock(image->mutex_, std::try_to_lock);  // who has it is about to use it
    if (!lock.owns_lock() || image->content_ == nullptr || image->content_.use_count() > 1) continue;
    image->content_.reset();
    memory = memory_.hold(bytes);
    if (memory != nullptr) break;
  }
  return memory;
}

Outcome<SharedImage> ImageStore::add(const ImageDecoder& decode, std::span<const std::byte> file,
                                     std::string owner, std::shared_ptr<const void> quota,
                                     const Seal<protocol::ImageDocument>& seal) {
  if (file.empty()) return Problem{.kind = ProblemKind::kEmptyBody, .detail = "the upload has no bytes"};
  auto content = decoded(decode, file, nullptr);
  if (!content.ok()) return content.problem();
  const Image& image = content.value()->image;
  auto stored = std::make_shared<StoredImage>();
  stored->document = {.id = random_id(),
                      .width = image.width,
                      .height = image.height,
                      .channels = channels_of(image),
                      .bytes = file.size(),
                      .created = std::chrono::system_clock::now()};
  stored->owner = std::move(owner);
  stored->quota = std::move(quota);
  stored->sha256 = sha256_hex(file);
  stored->content_ = std::move(content.value());
  auto entered = places_.enter(mutex_, images_, stored, [&]() -> Outcome<Done> {
    if (archive_ == nullptr) return Done{};
    std::optional<KeptAnswer> answer;
    if (seal) answer = seal(stored->document);
    return archive_->add(
        KeptImage{.document = stored->document, .sha256 = stored->sha256, .owner = stored->owner}, file,
        answer ? &*answer : nullptr);
  });
  if (!entered.ok()) return entered.problem();
  return SharedImage(stored);
}

Outcome<std::shared_ptr<const ImageContent>> ImageStore::content_of(const ImageDecoder& decode,
                                                                    const StoredImage& image) const {
  const std::lock_guard lock(image.mutex_);
  if (image.content_ != nullptr) return image.content_;
  POINTWRIGHT_CHECK(archive_ != nullptr, "content that is not there comes from an archive");
  const auto file = archive_->file(image.sha256);
  if (!file.ok()) return file.problem();
  auto content = decoded(decode, file.value(), &image);
  if (!content.ok()) return content;
  image.content_ = content.value();
  return content;
}

SharedImage ImageStore::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(images_.begin(), images_.end(), is_image(id));
  return it == images_.end() ? nullptr : *it;
}

std::vector<SharedImage> ImageStore::list() const {
  const std::lock_guard lock(mutex_);
  return images_;
}

Outcome<Done> ImageStore::remove(const std::string& id) {
  const std::lock_guard lock(mutex_);
  const auto it = std::find_if(images_.begin(), images_.end(), is_image(id));
  if (it == images_.end()) return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such image"};
  if (archive_ != nullptr)
    if (auto removed = archive_->remove_image(id, (*it)->sha256); !removed.ok()) return removed;
  images_.erase(it);
  return Done{};
}

}  // namespace pointwright::server
