#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace pepeseg {

struct KillServerReport {
  int64_t num_kills = 0;
  int64_t num_lives = 0;             // scenes from start to end (life_of_a_scene.h)
  std::vector<std::string> broken;   // acknowledged data that was lost, and wrong answers
  std::vector<std::string> unclean;  // files that nothing refers to, errors of the database
  absl::Duration slowest_start;      // longest time from a launch until the server answers

  std::string ToString() const;
};

// Kills pepesegd (SIGKILL) `num_kills` times at random moments, while `num_clients` clients run
// scene lives. Each server starts on the data of the one before it.
KillServerReport KillServerAgainAndAgain(int num_kills, int num_clients);

}  // namespace pepeseg
