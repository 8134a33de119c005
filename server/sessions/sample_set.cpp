#include "server/sessions/sample_set.h"

#include <utility>

#include "engine/spatial/splat_radius.h"
#include "protocol/frames/frame.h"

namespace pointwright::server {

SharedSamples samples_at_rest(Sampling sampling, const Level& rest) {
  auto radius = std::make_shared<std::vector<std::uint16_t>>();
  radius->reserve(sampling.size());
  for (const float value : splat_radii(rest.position, rest.normal, *sampling.graph))
    radius->push_back(protocol::to_bfloat16(value));
  return std::make_shared<const SampleSet>(SampleSet{
      .sampling = std::make_shared<const Sampling>(std::move(sampling)), .splat_radius = std::move(radius)});
}

}  // namespace pointwright::server
