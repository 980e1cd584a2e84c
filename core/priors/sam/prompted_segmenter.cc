#include "core/priors/sam/prompted_segmenter.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {

PromptAnswers AnswerGrid(int photo_width, int photo_height) {
  PromptAnswers grid;
  grid.cells_per_pixel = double{PromptAnswers::kExtent} / std::max(photo_width, photo_height);
  const auto cells = [&](int pixels) {
    return std::max(1, static_cast<int>(std::lround(pixels * grid.cells_per_pixel)));
  };
  grid.width = cells(photo_width);
  grid.height = cells(photo_height);
  return grid;
}

}  // namespace pepeseg
