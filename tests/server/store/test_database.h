#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

#include "tests/testing/temp_folder.h"

namespace pepeseg::testing {

// A PostgreSQL server for tests, on a socket in its own folder, without TCP. Killed by the
// destructor.
class PostgresqlServer {
 public:
  PostgresqlServer();
  ~PostgresqlServer();
  PostgresqlServer(const PostgresqlServer&) = delete;
  PostgresqlServer& operator=(const PostgresqlServer&) = delete;

  // Returns a URL for Store::Open with a schema of its own. `host`: folder of another socket to
  // connect by; empty: the server's.
  std::string NewDatabase(const std::string& host = "");
  // Returns the socket's path.
  std::filesystem::path socket() const;

  // Kills all processes of the server with SIGKILL.
  void Crash();
  // Starts the server again, which recovers.
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

// Returns the URL of an empty database: SQLite below `folder`, or, if the environment has
// PEPESEG_TEST_DATABASE=postgresql, a new one in this process's PostgreSQL server.
std::string NewTestDatabase(const std::filesystem::path& folder);
bool TestsRunOnPostgresql();

}  // namespace pepeseg::testing
