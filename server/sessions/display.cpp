#include "server/sessions/display.h"

#include <algorithm>
#include <iterator>

namespace pointwright::server {
namespace {

/// Frames of one picture that are kept: viewers mostly ask for the same delta, newcomers for the key.
constexpr std::size_t kKeptFrames = 3;
/// Frames that no viewer reads any more and whose memory the next one takes.
constexpr std::size_t kUnusedFrames = 1;
/// How many times more memory than it needs a frame may hold on to.
constexpr std::size_t kMostSlack = 4;

protocol::FrameState frame_state(const Picture& picture, const Cloud& cloud, std::uint32_t level) {
  return {.level = static_cast<std::uint8_t>(level),
          .revision = picture.revision,
          .sequence = picture.sequence,
          .origin = cloud.origin,
          .detail_range = picture.detail_range};
}

std::uint32_t finest_level(const Picture& picture) {
  return static_cast<std::uint32_t>(picture.surface->band_count());
}

}  // namespace

protocol::FrameColumns frame_columns(const Picture& picture, const Cloud& cloud, std::uint32_t level) {
  const std::size_t n = picture.surface->sample_count();
  protocol::FrameColumns columns;
  columns.position = &picture.surface->levels[level].position;
  columns.normal = &picture.surface->levels[level].normal;
  if (picture.field != nullptr) columns.t = std::span(picture.field->t).first(n);
  // The detail of a level is what carries it to the next finer one; of the finest one, what carried it there.
  if (picture.surface->band_count() > 0)
    columns.detail =
        std::span(picture.surface->detail[std::min<std::size_t>(level, picture.surface->band_count() - 1)])
            .first(n);
  columns.color = cloud.color;
  columns.marks = *picture.marks;
  columns.ids = cloud.id;
  if (picture.splat_radius != nullptr) columns.radius = *picture.splat_radius;
  return columns;
}

SharedFrame encode_picture(const protocol::FrameLayout& layout, const Picture& picture, const Cloud& cloud,
                           std::uint32_t level, std::uint16_t attributes) {
  auto bytes = std::make_shared<protocol::FrameBytes>();
  encode_key_frame(layout, frame_columns(picture, cloud, level), frame_state(picture, cloud, level),
                   attributes, *bytes);
  return bytes;
}

Display::Display(std::shared_ptr<const Cloud> cloud)
    : cloud_(std::move(cloud)), layout_(static_cast<std::uint32_t>(cloud_->size())), unused_(kUnusedFrames) {}

std::shared_ptr<Display::Shown> Display::shown() const {
  const std::lock_guard lock(mutex_);
  return shown_;
}

std::uint64_t Display::version() const {
  const auto now = shown();
  return now == nullptr ? 0 : now->version;
}

Picture Display::picture() const {
  const auto now = shown();
  return now == nullptr ? Picture{} : now->picture;
}

void Display::publish(Picture picture) {
  const auto before = shown();
  auto after = std::make_shared<Shown>();
  after->picture = std::move(picture);
  after->bounds = protocol::surface_bounds(after->picture.surface->finest().position);
  if (before == nullptr) {
    after->version = after->key_version = 1;
    after->block_versions.assign(layout_.block_count(), 1);
  } else {
    after->version = before->version + 1;
    after->key_version = before->key_version;
    after->block_versions = before->block_versions;
    const Picture& now = after->picture;
    if (now.detail_range != before->picture.detail_range) after->key_version = after->version;
    const auto changed = protocol::changed_blocks(
        layout_, frame_columns(before->picture, *cloud_, finest_level(now)),
        frame_columns(now, *cloud_, finest_level(now)), protocol::kAllFrameAttributes);
    for (const std::uint32_t block : changed) after->block_versions[block] = after->version;
  }
  const std::lock_guard lock(mutex_);
  shown_ = std::move(after);
}

Display::Frame Display::frame_since(std::uint64_t version, std::uint16_t attributes) {
  const auto now = shown();
  if (now == nullptr) return {};
  const std::uint64_t since = version < now->key_version ? 0 : version;
  // Held while encoding: of several viewers that want the same frame one makes it, and the others wait for
  // it.
  const std::lock_guard lock(now->frames_mutex);
  auto& frames = now->frames;
  const auto kept = std::find_if(frames.begin(), frames.end(), [&](const KeptFrame& f) {
    return f.since == since && f.attributes == attributes;
  });
  if (kept != frames.end()) {
    std::rotate(frames.begin(), kept, std::next(kept));
    return {frames.front().bytes, now->version};
  }
  const std::uint32_t level = finest_level(now->picture);
  auto state = frame_state(now->picture, *cloud_, level);
  state.bounds = now->bounds;
  const auto columns = frame_columns(now->picture, *cloud_, level);
  auto bytes = unused_.take();
  if (bytes == nullptr) bytes = std::make_unique<protocol::FrameBytes>();
  if (since == 0) {
    encode_key_frame(layout_, columns, state, attributes, *bytes);
  } else {
    std::vector<std::uint32_t> blocks;
    for (std::uint32_t block = 0; block < layout_.block_count(); ++block)
      if (now->block_versions[block] > since) blocks.push_back(block);
    encode_delta_frame(layout_, columns, state, attributes, blocks, *bytes);
  }
  if (bytes->capacity() > kMostSlack * bytes->size()) bytes->shrink_to_fit();
  if (frames.size() == kKeptFrames) frames.pop_back();
  frames.insert(frames.begin(),
                {.since = since, .attributes = attributes, .bytes = unused_.share(std::move(bytes))});
  return {frames.front().bytes, now->version};
}

}  // namespace pointwright::server
