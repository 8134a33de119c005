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

protocol::FrameState frame_state(const Picture& picture, std::uint32_t level) {
  return {.level = static_cast<std::uint8_t>(level),
          .revision = picture.revision,
          .sequence = picture.sequence,
          .origin = picture.samples->cloud().origin,
          .detail_range = picture.detail_range,
          .stretch_range = picture.samples->stretch_range};
}

protocol::FrameLayout layout_of(const Picture& picture) {
  return protocol::FrameLayout(static_cast<std::uint32_t>(picture.samples->size()));
}

std::uint32_t finest_level(const Picture& picture) {
  return static_cast<std::uint32_t>(picture.surface->band_count());
}

}  // namespace

protocol::FrameColumns frame_columns(const Picture& picture, std::uint32_t level) {
  const std::size_t n = picture.surface->sample_count();
  protocol::FrameColumns columns;
  columns.position = &picture.surface->levels[level].position;
  columns.normal = &picture.surface->levels[level].normal;
  if (picture.t != nullptr) columns.t = std::span(*picture.t).first(n);
  // The detail of a level is what carries it to the next finer one; of the finest one, what carried it there.
  if (picture.surface->band_count() > 0)
    columns.detail =
        std::span(picture.surface->detail[std::min<std::size_t>(level, picture.surface->band_count() - 1)])
            .first(n);
  columns.stretch = picture.samples->stretch;
  columns.color = picture.samples->cloud().color;
  columns.marks = *picture.marks;
  columns.ids = picture.samples->cloud().id;
  columns.radius = *picture.samples->splat_radius;
  return columns;
}

SharedFrame encode_picture(const Picture& picture, std::uint32_t level, std::uint16_t attributes) {
  auto bytes = std::make_shared<protocol::FrameBytes>();
  encode_key_frame(layout_of(picture), frame_columns(picture, level), frame_state(picture, level), attributes,
                   *bytes);
  return bytes;
}

Display::Display() : unused_(kUnusedFrames) {}

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
  const Picture& now = after->picture;
  if (before == nullptr || !are_same(*before->picture.samples, *now.samples)) {
    // Other samples have other places in frames, and their own ids and radii.
    after->version = after->key_version = before == nullptr ? 1 : before->version + 1;
    after->layout = layout_of(now);
    after->block_versions.assign(after->layout.block_count(), after->version);
  } else {
    after->version = before->version + 1;
    after->key_version = before->key_version;
    after->layout = before->layout;
    after->block_versions = before->block_versions;
    if (now.detail_range != before->picture.detail_range ||
        now.samples->stretch_range != before->picture.samples->stretch_range)
      after->key_version = after->version;
    const auto changed =
        protocol::changed_blocks(after->layout, frame_columns(before->picture, finest_level(now)),
                                 frame_columns(now, finest_level(now)), protocol::kAllFrameAttributes);
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
  auto state = frame_state(now->picture, level);
  state.bounds = now->bounds;
  const auto columns = frame_columns(now->picture, level);
  auto bytes = unused_.take();
  if (bytes == nullptr) bytes = std::make_unique<protocol::FrameBytes>();
  bytes->clear();  // nothing of it is wanted where more memory is needed
  if (since == 0) {
    encode_key_frame(now->layout, columns, state, attributes, *bytes);
  } else {
    std::vector<std::uint32_t> blocks;
    for (std::uint32_t block = 0; block < now->layout.block_count(); ++block)
      if (now->block_versions[block] > since) blocks.push_back(block);
    encode_delta_frame(now->layout, columns, state, attributes, blocks, *bytes);
  }
  if (bytes->capacity() > kMostSlack * bytes->size()) bytes->shrink_to_fit();
  if (frames.size() == kKeptFrames) frames.pop_back();
  frames.insert(frames.begin(),
                {.since = since, .attributes = attributes, .bytes = unused_.share(std::move(bytes))});
  return {frames.front().bytes, now->version};
}

}  // namespace pointwright::server
