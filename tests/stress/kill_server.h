#pragma once

#include <cstdint>
#include <filesystem>
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

struct FaultReport {
  int64_t num_points = 0;  // calls that can be broken
  int64_t num_tried = 0;
  int64_t num_fired = 0;  // of those, the server ended by it
  std::vector<std::string> broken, unclean;

  std::string ToString() const;
};

// One life of a scene for each of the server's calls of fsync, fdatasync, rename and unlink, in
// which it is killed just before that call, and one just after it. `stride`: tries every so many.
FaultReport KillAtEveryDurableCall(int stride);

// One life for each call from which on the disk is full: it ends in errors that say so, and goes on
// when there is space again.
FaultReport FillDiskAtEveryCall(int stride);

// What is wrong with a data directory that no server uses, when each life in it is done.
std::vector<std::string> FindUnclean(const std::filesystem::path& data);

}  // namespace pepeseg
