#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "server/store/soci.h"

namespace pepeseg {

// Runs one SQL statement for many records, with one round trip to the database for every 64 of
// them. For use inside one transaction; throws what SOCI throws.
class BatchStatement {
 public:
  using Value = std::variant<int64_t, std::string>;
  // The statement is `before`, then `record` for each record, joined by `between`, then `after`.
  // Each '?' in `record` is replaced by the next value of Add.
  struct Text {
    std::string before, record, between, after;
  };

  BatchStatement(soci::session& sql, Text text) : sql_(sql), text_(std::move(text)) {}
  // Adds a record's values, and runs the statement when 64 records are collected.
  void Add(std::vector<Value> record);
  // Runs what remains. Returns the number of records that all runs have changed.
  int64_t Finish();

 private:
  void Run();

  soci::session& sql_;
  const Text text_;
  std::vector<Value> values_;
  int num_records_ = 0;
  int64_t num_changed_ = 0;
};

}  // namespace pepeseg
