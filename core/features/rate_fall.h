#pragma once

namespace pepeseg {

// Steps of a schedule that are left out, from the first num_done on.
struct LeftOutSteps {
  int num_done = 0;
  int num = 0;  // at most those that are left
};

// What share of the fall of a learning rate over num_steps lies behind a step that follows `done`
// others, [0, 1]: after steps were left out, the rest of the fall is done in those that remain,
// from where it was.
inline double ShareOfFall(int done, int num_steps, const LeftOutSteps& left_out) {
  if (done <= left_out.num_done) return static_cast<double>(done) / num_steps;
  const int planned = num_steps - left_out.num_done, remaining = planned - left_out.num;
  if (done >= left_out.num_done + remaining) return 1;
  return (left_out.num_done + static_cast<double>(done - left_out.num_done) * planned / remaining) /
         num_steps;
}

}  // namespace pepeseg
