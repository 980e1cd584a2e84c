#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

struct sqlite3;
struct sqlite3_stmt;

namespace pepeseg {

// A connection to an SQLite file. Closing it without a commit undoes what it has written. Not
// thread safe.
class SqliteConnection {
 public:
  explicit SqliteConnection(const std::filesystem::path& path) : path_(path.string()) {}
  ~SqliteConnection();
  SqliteConnection(const SqliteConnection&) = delete;
  SqliteConnection& operator=(const SqliteConnection&) = delete;

  // Opens the file, or creates it. INTERNAL: it cannot be opened, or exists and `create` is true.
  absl::Status Open(bool create);
  // Runs statements that have no results. Errors as Failed.
  absl::Status Execute(const char* sql);
  // Returns SQLite's last error: DATA_LOSS if the file is damaged or lacks a table, else INTERNAL.
  absl::Status Failed(absl::string_view doing) const;

  const std::string& path() const { return path_; }
  sqlite3* db() const { return db_; }

 private:
  std::string path_;
  sqlite3* db_ = nullptr;
};

// A prepared statement. Columns of results and parameters count from 0. The connection must outlive
// it.
class SqliteStatement {
 public:
  // A mistake in `sql` is an error of the first call of Next or Insert.
  SqliteStatement(const SqliteConnection& connection, const char* sql);
  ~SqliteStatement();
  SqliteStatement(const SqliteStatement&) = delete;
  SqliteStatement& operator=(const SqliteStatement&) = delete;

  // Advances to the next record of the results. False: there is none. Errors as Failed.
  absl::StatusOr<bool> Next();
  int64_t Integer(int column);
  // Returns the bytes of a text or blob, valid until the next call of Next.
  absl::string_view Bytes(int column);

  void BindInteger(int parameter, int64_t value);
  // The text and the bytes must stay until Insert. Empty bytes become an empty blob, not NULL.
  void BindText(int parameter, const std::string& text);
  void BindBytes(int parameter, const void* bytes, size_t size);
  // Runs the statement with what is bound, and makes it ready for the next record.
  absl::Status Insert();

 private:
  const SqliteConnection& connection_;
  sqlite3_stmt* statement_ = nullptr;
};

}  // namespace pepeseg
