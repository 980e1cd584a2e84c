#include "server/store/schema.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <latch>
#include <map>
#include <thread>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/file_io.h"
#include "server/store/soci.h"
#include "server/store/store.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

// By name of a table, its columns in order. By name of an index, the name of its table.
using SchemaMap = std::map<std::string, std::vector<std::string>>;

// A connection to the database of a URL for Store::Open.
class Connection {
 public:
  explicit Connection(const std::string& url)
      : is_sqlite_(absl::StartsWith(url, "sqlite:")),
        sql_(is_sqlite_ ? soci::session(soci::sqlite3,
                                        absl::StrCat("dbname=\"", url.substr(7), "\" timeout=10"))
                        : soci::session(**PostgresqlBackend(), url.substr(11))) {}

  // Returns the texts that a query with one column selects.
  std::vector<std::string> Select(const std::string& query) {
    std::vector<std::string> texts;
    std::string text;
    soci::statement select = (sql_.prepare << query, soci::into(text));
    select.execute();
    while (select.fetch()) texts.push_back(text);
    return texts;
  }

  void Execute(const std::string& statement) { sql_ << statement; }

  // Returns all tables and indexes, but those indexes that a constraint of a table makes.
  SchemaMap List() {
    SchemaMap found;
    const std::string tables =
        is_sqlite_ ? "SELECT name FROM sqlite_master WHERE type = 'table'"
                   : "SELECT tablename::text FROM pg_tables WHERE schemaname = current_schema()";
    for (const std::string& table : Select(tables)) found[table] = Columns(table);
    const std::string indexes =
        is_sqlite_ ? "SELECT name || ' ' || tbl_name FROM sqlite_master"
                     " WHERE type = 'index' AND sql IS NOT NULL"
                   : "SELECT indexname || ' ' || tablename FROM pg_indexes WHERE schemaname ="
                     " current_schema() AND NOT EXISTS (SELECT 1 FROM pg_constraint c JOIN pg_class"
                     " i ON i.oid = c.conindid WHERE i.relname = indexname AND i.relnamespace ="
                     " current_schema()::regnamespace)";
    for (const std::string& index : Select(indexes)) {
      const std::vector<std::string> names = absl::StrSplit(index, ' ');
      found[names.at(0)] = {names.at(1)};
    }
    return found;
  }

 private:
  std::vector<std::string> Columns(const std::string& table) {
    if (is_sqlite_) {
      return Select(absl::StrCat("SELECT name FROM pragma_table_info('", table, "') ORDER BY cid"));
    }
    return Select(
        absl::StrCat("SELECT column_name::text FROM information_schema.columns WHERE table_schema ="
                     " current_schema() AND table_name = '",
                     table, "' ORDER BY ordinal_position"));
  }

  const bool is_sqlite_;
  soci::session sql_;
};

// Returns the tables and indexes of the text, and schema_version.
SchemaMap Expected() {
  SchemaMap expected = {{"schema_version", {"version"}}};
  for (const std::string& statement : SchemaStatements()) {
    const std::vector<std::string> words = absl::StrSplit(statement, ' ');
    if (absl::StartsWith(statement, "CREATE INDEX")) expected[words.at(2)] = {words.at(4)};
    if (absl::StartsWith(statement, "CREATE UNIQUE INDEX")) expected[words.at(3)] = {words.at(5)};
    if (!absl::StartsWith(statement, "CREATE TABLE")) continue;
    std::vector<std::string>& columns = expected[words.at(2)];
    const size_t begin = statement.find('(') + 1;
    const std::string body = statement.substr(begin, statement.rfind(')') - begin);
    for (const absl::string_view line : absl::StrSplit(body, '\n')) {
      const std::vector<std::string> parts =
          absl::StrSplit(absl::StripAsciiWhitespace(line), ' ', absl::SkipEmpty());
      if (parts.empty() || parts[0] == "PRIMARY" || parts[0] == "FOREIGN") continue;
      columns.push_back(parts[0]);
    }
  }
  return expected;
}

TEST(Schema, IsTheTextOfTheFile) {
  const std::string path = PEPESEG_SCHEMA_FILE;
  EXPECT_EQ(*ReadFile(path, path, 1 << 20), kSchemaText);
  const std::vector<std::string> statements = SchemaStatements();
  EXPECT_EQ(statements.size(), 26u) << "13 tables, 11 indexes, 2 records";
  for (const std::string& statement : statements) {
    EXPECT_THAT(statement, MatchesRegex("(CREATE|INSERT)[^;:]*[)']")) << "no comment, no ';'";
  }
}

TEST(Schema, IsThatOfANewDatabase) {
  const testing::TempFolder folder;
  const std::string url = testing::NewTestDatabase(folder.path());
  ASSERT_OK(Store::Open(url));
  Connection database(url);
  EXPECT_EQ(database.List(), Expected());
  EXPECT_THAT(database.Select("SELECT CAST(version AS VARCHAR(9)) FROM schema_version"),
              ::testing::ElementsAre(absl::StrCat(kSchemaVersion)));
}

TEST(Schema, StaysWhenAServerStartsAgain) {
  const testing::TempFolder folder;
  const std::string url = testing::NewTestDatabase(folder.path());
  ASSERT_OK((*Store::Open(url))->scenes().CreateScene(NewScene("a", "A", "")));
  ASSERT_OK_AND_ASSIGN(const auto store, Store::Open(url));
  EXPECT_OK(store->scenes().FindScene(kDefaultProject, "a"));
  EXPECT_EQ(Connection(url).List(), Expected());
}

TEST(Schema, RefusesAnotherVersion) {
  const testing::TempFolder folder;
  const std::string url = testing::NewTestDatabase(folder.path());
  ASSERT_OK((*Store::Open(url))->scenes().CreateScene(NewScene("a", "A", "")));
  const auto set = [&url](int version) {
    Connection(url).Execute(absl::StrCat("UPDATE schema_version SET version = ", version));
  };
  set(kSchemaVersion + 1);
  const absl::Status newer = Store::Open(url).status();
  EXPECT_EQ(newer.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(newer.message(),
              HasSubstr(absl::StrCat("schema version ", kSchemaVersion + 1,
                                     ", and this program needs version ", kSchemaVersion)));
  EXPECT_THAT(newer.message(), HasSubstr("restore a backup that this one can read"));
  set(kSchemaVersion - 1);
  const absl::Status older = Store::Open(url).status();
  EXPECT_EQ(older.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(older.message(), HasSubstr("start with a new data directory and an empty database"));
  // The refusals changed nothing.
  set(kSchemaVersion);
  ASSERT_OK_AND_ASSIGN(const auto store, Store::Open(url));
  EXPECT_OK(store->scenes().FindScene(kDefaultProject, "a"));
}

// Servers share a PostgreSQL database. A SQLite one belongs to a data folder, which one server
// locks, and SQLite refuses a second connection that turns on its log at the same moment.
TEST(Schema, IsMadeOnceByServersThatStartTogether) {
  if (!testing::TestsRunOnPostgresql()) GTEST_SKIP() << "one server uses a SQLite database";
  constexpr int kNumServers = 4;
  const testing::TempFolder folder;
  for (int round = 0; round < 5; ++round) {
    const std::string url = testing::NewTestDatabase(folder.path());
    std::vector<absl::Status> opened(kNumServers);
    std::latch together(kNumServers);
    std::vector<std::jthread> servers;
    for (absl::Status& status : opened) {
      servers.emplace_back([&] {
        together.arrive_and_wait();
        status = Store::Open(url).status();
      });
    }
    servers.clear();  // joins them
    for (const absl::Status& status : opened) EXPECT_OK(status);
    Connection database(url);
    EXPECT_EQ(database.List(), Expected());
    for (const char* table : {"schema_version", "job_numbers", "scene_numbers"}) {
      const std::string count = "SELECT CAST(COUNT(*) AS VARCHAR(9)) FROM ";
      EXPECT_THAT(database.Select(count + table), ::testing::ElementsAre("1")) << table;
    }
  }
}

}  // namespace
}  // namespace pepeseg
