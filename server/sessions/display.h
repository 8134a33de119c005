#pragma once
// What a session shows right now, and the frames that bring a viewer from what it saw last to that.

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "engine/editing/painting.h"
#include "engine/multires/surface.h"
#include "protocol/frames/frame.h"
#include "protocol/frames/layout.h"
#include "server/base/recycler.h"
#include "server/sessions/sample_set.h"

namespace pointwright::server {

/// One thing shown. Immutable once published.
struct Picture {
  std::shared_ptr<const MultiresSurface> surface;
  std::shared_ptr<const std::vector<float>> t;  ///< may be padded; null: 0 everywhere
  std::shared_ptr<const Marks> marks;
  SharedSamples samples;
  float detail_range = 0.0F;
  std::uint64_t revision = 0;
  std::uint64_t sequence = 0;  ///< of the preview; 0 for the committed state
};

using SharedFrame = std::shared_ptr<const protocol::FrameBytes>;

/// Publishes pictures and encodes frames between them. Thread-safe.
class Display {
 public:
  Display();

  /// Shows another picture: one writer at a time. Cost: O(N).
  void publish(Picture picture);

  /// Grows by one with each picture; 0 while there is none.
  [[nodiscard]] std::uint64_t version() const;
  /// What is shown; an empty Picture while there is nothing.
  [[nodiscard]] Picture picture() const;

  struct Frame {
    SharedFrame bytes;  ///< null while there is nothing to show
    std::uint64_t version = 0;
  };
  /// The frame that brings a viewer which saw `version` (0: nothing) to the newest picture: a delta with the
  /// blocks that changed since, or a key where the samples or the ranges differ. Frames are shared by all
  /// viewers that ask for the same one.
  Frame frame_since(std::uint64_t version, std::uint16_t attributes);

 private:
  struct KeptFrame {
    std::uint64_t since = 0;
    std::uint16_t attributes = 0;
    SharedFrame bytes;
  };
  struct Shown {
    Picture picture;
    protocol::FrameLayout layout;
    protocol::SurfaceBounds bounds;
    std::uint64_t version = 0;
    std::uint64_t key_version = 0;              // viewers of older pictures need a key
    std::vector<std::uint64_t> block_versions;  // the picture in which each block last changed
    std::mutex frames_mutex;                    // guards frames
    std::vector<KeptFrame> frames;              // a few, the last used one first
  };
  [[nodiscard]] std::shared_ptr<Shown> shown() const;

  Recycler<protocol::FrameBytes> unused_;
  mutable std::mutex mutex_;  // guards shown_
  std::shared_ptr<Shown> shown_;
};

/// The columns of a picture's level, as frames take them.
protocol::FrameColumns frame_columns(const Picture& picture, std::uint32_t level);

/// The key frame of a picture's level, on its own.
SharedFrame encode_picture(const Picture& picture, std::uint32_t level, std::uint16_t attributes);

}  // namespace pointwright::server
