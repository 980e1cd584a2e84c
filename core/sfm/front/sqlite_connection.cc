#include "core/sfm/front/sqlite_connection.h"

#include <sqlite3.h>

#include "absl/strings/str_cat.h"

namespace pepeseg {

SqliteConnection::~SqliteConnection() { sqlite3_close(db_); }

absl::Status SqliteConnection::Open(bool create) {
  std::error_code ignored;
  if (create && std::filesystem::exists(path_, ignored)) {
    return absl::InternalError(absl::StrCat(path_, " exists already"));
  }
  const int flags = SQLITE_OPEN_READWRITE | (create ? SQLITE_OPEN_CREATE : 0);
  if (sqlite3_open_v2(path_.c_str(), &db_, flags, nullptr) == SQLITE_OK) return absl::OkStatus();
  return Failed("open");
}

absl::Status SqliteConnection::Execute(const char* sql) {
  if (sqlite3_exec(db_, sql, nullptr, nullptr, nullptr) == SQLITE_OK) return absl::OkStatus();
  return Failed("write");
}

absl::Status SqliteConnection::Failed(absl::string_view doing) const {
  const int code = sqlite3_errcode(db_);
  const std::string text = absl::StrCat("cannot ", doing, " ", path_, ": ", sqlite3_errmsg(db_));
  // SQLITE_ERROR: the statement does not fit the tables.
  const bool damaged = code == SQLITE_CORRUPT || code == SQLITE_NOTADB || code == SQLITE_ERROR;
  return damaged ? absl::DataLossError(text) : absl::InternalError(text);
}

SqliteStatement::SqliteStatement(const SqliteConnection& connection, const char* sql)
    : connection_(connection) {
  sqlite3_prepare_v2(connection.db(), sql, -1, &statement_, nullptr);
}

SqliteStatement::~SqliteStatement() { sqlite3_finalize(statement_); }

absl::StatusOr<bool> SqliteStatement::Next() {
  if (statement_ == nullptr) return connection_.Failed("read");
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return connection_.Failed("read");
}

int64_t SqliteStatement::Integer(int column) { return sqlite3_column_int64(statement_, column); }

absl::string_view SqliteStatement::Bytes(int column) {
  const void* bytes = sqlite3_column_blob(statement_, column);
  if (bytes == nullptr) return {};
  return {static_cast<const char*>(bytes),
          static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
}

void SqliteStatement::BindInteger(int parameter, int64_t value) {
  sqlite3_bind_int64(statement_, parameter + 1, value);
}

void SqliteStatement::BindText(int parameter, const std::string& text) {
  sqlite3_bind_text64(statement_, parameter + 1, text.data(), text.size(), SQLITE_STATIC,
                      SQLITE_UTF8);
}

void SqliteStatement::BindBytes(int parameter, const void* bytes, size_t size) {
  sqlite3_bind_blob64(statement_, parameter + 1, size == 0 ? "" : bytes, size, SQLITE_STATIC);
}

absl::Status SqliteStatement::Insert() {
  if (statement_ == nullptr || sqlite3_step(statement_) != SQLITE_DONE) {
    return connection_.Failed("write");
  }
  sqlite3_reset(statement_);
  return absl::OkStatus();
}

}  // namespace pepeseg
