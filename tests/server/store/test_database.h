#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

#include "tests/testing/temp_folder.h"

namespace pepeseg::testing {

// A PostgreSQL server of its own: on a socket in a folder of its own, without TCP, killed with the
// object.
class PostgresqlServer {
 public:
  PostgresqlServer();
  ~PostgresqlServer();
  PostgresqlServer(const PostgresqlServer&) = delete;
  PostgresqlServer& operator=(const PostgresqlServer&) = delete;

  // Store::Open's, of a namespace in it that nothing else uses; by another socket's folder, if that
  // is not empty.
  std::string NewDatabase(const std::string& host = "");
  // Where it listens.
  std::filesystem::path socket() const;

  // kill -9 of all its processes, and a start that recovers.
  void Crash();
  void Restart();

 private:
  void Start();
  void StopNow();
  std::string Connection(const std::string& host = "") const;

  TempFolder folder_;
  std::string programs_;  // folder of initdb and postgres
  pid_t pid_ = 0;
  int num_databases_ = 0;
};

// An empty database for one test: SQLite below `folder`, or, where the environment has
// PEPESEG_TEST_DATABASE=postgresql, in the one PostgreSQL server of this process.
std::string NewTestDatabase(const std::filesystem::path& folder);
bool TestsRunOnPostgresql();

}  // namespace pepeseg::testing
