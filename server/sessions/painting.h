#pragma once
// A region as it was painted, and what regions are called.

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/editing/painting.h"
#include "protocol/json/requests.h"

namespace pointwright::server {

/// The operations of a painting. Lists share them: appending copies none.
using OperationList = std::vector<std::shared_ptr<const PaintOperation>>;

/// One region as it was painted.
struct Painting {
  std::size_t samples = 0;
  std::size_t vertices = 0;  ///< of strokes and outlines, and balls
  std::shared_ptr<const OperationList> operations;
};

/// Which region: the zero- or the one-region, or another one by its name.
struct RegionId {
  std::optional<RegionKind> kind;
  std::string name;

  RegionId(RegionKind of)  // NOLINT(google-explicit-constructor): the two are regions as well
      : kind(of), name(protocol::region_name(of)) {}
  explicit RegionId(std::string of) : kind(protocol::region_of_name(of)), name(std::move(of)) {}
};

}  // namespace pointwright::server
