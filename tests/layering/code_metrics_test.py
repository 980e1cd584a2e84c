#!/usr/bin/env python3
"""code_metrics.py must count what is planted."""
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import code_metrics  # noqa: E402

HARD = r'''// A comment.
#define MACRO(x) { if (x) { } }
namespace pepeseg {
template <typename T = int, int N = 2>
struct Pair : Base<T> {
  Pair(int a, T b = {}) : a_(a), b_{b} { Use(a); }
  T value() const { return b_; }
  bool operator==(const Pair& other) const { return a_ == other.a_; }
  int table[2] = {1, 2};
};
/* Two lines
   of comment. */
constexpr char kText[] = "{ not a brace \" }";
const auto kLambda = [](int x) { return Call(x); };
enum class Kind { kA, kB };
extern "C" { void Declared(int); }
static absl::StatusOr<std::map<int, std::string>> Long(
    const std::map<int, std::string>& map,  // a trailing comment
    absl::FunctionRef<void(int, int)> use) {
  for (const auto& [key, value] : map) {
    if (key) { use(key, 0); }
  }
  return Inner<int>(map);
}
void Pepe::Member(void) noexcept {
}
}  // namespace pepeseg
'''

TREE = {
    "server/rpc/answer.h": "Status Answer(Context* c);\n",
    "server/rpc/answer.cc": "Status Answer(Context* c) {\n  return 0;\n}\n",
    "core/io/load.h": "inline int Load(int a) { return a; }\ninline int Unused() { return 0; }\n",
}
failures = []


def expect(what, actual, expected):
    if actual != expected:
        failures.append(f"{what}: {actual}, not {expected}")


def test_functions():
    found = code_metrics.find_functions(HARD)
    expect("functions", [(f.name, f.lines, f.parameters) for f in found],
           [("Pair", 1, 2), ("value", 1, 0), ("operator==", 1, 1), ("Long", 8, 2),
            ("Member", 2, 0)])
    expect("comments", code_metrics.count_comments(HARD), (3, len(HARD.splitlines())))


def test_quantiles():
    expect("median", code_metrics.quantile([4, 1, 3, 2], 50), 2)
    expect("p90", code_metrics.quantile(range(1, 11), 90), 9)


def test_tree():
    with tempfile.TemporaryDirectory() as root:
        for name, text in TREE.items():
            path = pathlib.Path(root, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        done = subprocess.run([sys.executable, code_metrics.__file__, root], text=True,
                              capture_output=True, check=True)
    for row in ("| units | 2 | 0 |", "| files | 3 | 0 |", "| files of 40 lines or fewer | 100 % |",
                "| functions | 3 | 0 |"):
        if row not in done.stdout:
            failures.append(f"lacks {row}\n{done.stdout}")


test_functions()
test_quantiles()
test_tree()
print("\n".join(failures), end="\n" if failures else "")
sys.exit(1 if failures else 0)
