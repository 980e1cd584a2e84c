#include "core/prompt/levels.h"

namespace pepeseg {

std::vector<uint8_t> LevelsOf(std::span<const float> similarity,
                              std::span<const float> thresholds) {
  std::vector<uint8_t> levels(similarity.size());
  for (const float threshold : thresholds) {  // a pass each, which the compiler makes vectors of
    for (size_t i = 0; i < levels.size(); ++i) levels[i] += similarity[i] > threshold ? 1 : 0;
  }
  return levels;
}

}  // namespace pepeseg
