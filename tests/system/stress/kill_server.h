#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace pepeseg {

struct KillServerReport {
  int64_t num_kills = 0;
  int64_t num_lives = 0;             // scenes from start to end (life_of_a_scene.h)
  std::vector<std::string> broken;   // what was acknowledged and lost, or answered wrongly
  std::vector<std::string> unclean;  // files that nothing refers to, faults of the database
  absl::Duration slowest_start;      // from the launch until it answers

  std::string ToString() const;
};

// kill -9 of pepesegd, `num_kills` times at random moments, while `num_clients` live the lives of
// scenes; each start is on the data of the one before it.
KillServerReport KillServerAgainAndAgain(int num_kills, int num_clients);

}  // namespace pepeseg
