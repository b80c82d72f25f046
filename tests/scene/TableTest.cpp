#include <stdexcept>

#include "TestFiles.h"
#include "genu/io/Files.h"
#include "genu/io/Table.h"

namespace genu::io {
namespace {

using test::messageOf;
using test::TemporaryFolder;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

TEST(Table, ReadsCsv) {
  const Table table = parseTable("# a comment\n\ntime, rz\n0, -5.5\n0.5,1e1\n\n1,+3\n", "a.csv");
  EXPECT_THAT(table.columns, ElementsAre("time", "rz"));
  EXPECT_THAT(table.data[0], ElementsAre(0, 0.5, 1));
  EXPECT_THAT(table.data[1], ElementsAre(-5.5, 10, 3));
  EXPECT_THAT(table.lines, ElementsAre(4, 5, 7));
  EXPECT_EQ(table.numRows(), 3);
  EXPECT_EQ(table.getColumn("rz", ""), 1);
  EXPECT_FALSE(table.inDegrees);
}

TEST(Table, ReadsCsvDialects) {
  for (const char* text : {"time;a\n0;1\n1;2\n", "time\ta\r\n0\t1\r\n1\t2\r\n", "\xef\xbb\xbftime,a\n0,1\n1,2",
                           "\"time\",\"a\"\n\"0\",\"1\"\n1,2\n", "time,a\r0,1\r1,2\r"}) {
    const Table table = parseTable(text, "a.csv");
    EXPECT_THAT(table.columns, ElementsAre("time", "a")) << text;
    EXPECT_THAT(table.data[1], ElementsAre(1, 2)) << text;
  }
  const Table quoted = parseTable("time,\"a, \"\"b\"\"\"\n0,1\n", "a.csv");
  EXPECT_EQ(quoted.columns[1], "a, \"b\"");
}

TEST(Table, CsvErrorsNameLineAndColumn) {
  const auto message = [](const std::string& text) { return messageOf([&] { parseTable(text, "dir/a.csv"); }); };
  EXPECT_THAT(message("time,a\n0,1\n1,2,3\n"),
              AllOf(StartsWith("dir/a.csv:3: 3 values"), HasSubstr("names 2 columns")));
  EXPECT_THAT(message("time,a\n0,1\n1\n"), StartsWith("dir/a.csv:3: 1 values"));
  EXPECT_THAT(message("time,a\n0,1\n1,NaN\n"),
              AllOf(StartsWith("dir/a.csv:3: column \"a\" (2) is NaN"), HasSubstr("number")));
  EXPECT_THAT(message("time,a\n0,1\n1,inf\n"),
              AllOf(StartsWith("dir/a.csv:3: column \"a\" (2)"), HasSubstr("infinite")));
  EXPECT_THAT(message("time,a\n0,1\n1,\n"), StartsWith("dir/a.csv:3: column \"a\" (2) is empty"));
  EXPECT_THAT(message("time,a\n0,1\n1,2 mm\n"), HasSubstr("\"2 mm\" is not a plain number"));
  EXPECT_THAT(message("# c\ntime,a\n0,1\n# c\n0,2\n"),
              StartsWith("dir/a.csv:5: column \"time\" is 0 after 0; it must increase"));
  EXPECT_THAT(message("time,time\n0,1\n"), AllOf(StartsWith("dir/a.csv:1: column 2 repeats"), HasSubstr("\"time\"")));
  EXPECT_THAT(message("time,\n0,1\n"), StartsWith("dir/a.csv:1: column 2 has no name"));
  EXPECT_THAT(message("time,a\n"), AllOf(StartsWith("dir/a.csv:1: "), HasSubstr("no row of numbers")));
  EXPECT_THAT(message(""), HasSubstr("is empty"));
  EXPECT_THAT(message("time,a\n0,\"1\n"), HasSubstr("never closed"));
  EXPECT_THAT(message("time,a\n0,\"1\"x\n"), AllOf(StartsWith("dir/a.csv:2: "), HasSubstr("not valid CSV")));
  EXPECT_THAT(message("1,2\n3,4,\n"), StartsWith("dir/a.csv:2: 3 values"));
}

TEST(Table, QuotedLineBreakKeepsLineNumbers) {
  EXPECT_THAT(messageOf([] { parseTable("time,\"a\nb\"\n0,1\n1,x\n", "a.csv"); }), StartsWith("a.csv:4: "));
}

TEST(Table, UnknownExtension) {
  EXPECT_THAT(messageOf([] { parseTable("time,a\n0,1\n", "a.xls"); }),
              AllOf(HasSubstr("\".xls\""), HasSubstr(".csv, .sto, .mot")));
}

constexpr const char* kSto =
    "Coordinates\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\nany words\nendheader\n"
    "time\tknee_angle\tx\t\n0.0\t-5\t0.1\n  0.5\t10\t0.2\n";

TEST(Table, ReadsStoAndMot) {
  for (const char* name : {"a.sto", "a.mot"}) {
    const Table table = parseTable(kSto, name);
    EXPECT_THAT(table.columns, ElementsAre("time", "knee_angle", "x"));
    EXPECT_THAT(table.data[1], ElementsAre(-5, 10));
    EXPECT_TRUE(table.inDegrees);
    EXPECT_EQ(table.name, "Coordinates");
  }
  // Blanks instead of tabs, an old header, no counts.
  const Table blanks = parseTable("Results\ndatacolumns 2\nendheader\ntime  a\n 0   1\n 1   2\n", "b.mot");
  EXPECT_THAT(blanks.data[1], ElementsAre(1, 2));
  EXPECT_FALSE(blanks.inDegrees);
}

TEST(Table, StoErrors) {
  const auto message = [](const std::string& text) { return messageOf([&] { parseTable(text, "a.sto"); }); };
  EXPECT_THAT(message("time\ta\n0\t1\n"), HasSubstr("endheader"));
  EXPECT_THAT(message("n\ninDegrees=perhaps\nendheader\ntime\ta\n0\t1\n"),
              AllOf(StartsWith("a.sto:2: "), HasSubstr("yes, no")));
  EXPECT_THAT(message("n\nnRows=3\nendheader\ntime\ta\n0\t1\n"),
              AllOf(StartsWith("a.sto:2: nRows=3"), HasSubstr("1 rows")));
  EXPECT_THAT(message("n\nnRows=x\nendheader\ntime\ta\n0\t1\n"), HasSubstr("is not a count"));
  EXPECT_THAT(message("n\nnColumns=3\nendheader\ntime\ta\n0\t1\n"), HasSubstr("has 2 columns"));
  EXPECT_THAT(message("n\nendheader\nangle\ta\n0\t1\n"), HasSubstr("must be \"time\""));
  EXPECT_THAT(message("n\nendheader\ntime\ta\n0\t1\n0.1\n"), StartsWith("a.sto:5: 1 values"));
  EXPECT_THAT(message("n\nendheader\ntime\ta\n0\tnan\n"),
              AllOf(StartsWith("a.sto:4: "), HasSubstr("\"a\" (2) is nan")));
  EXPECT_THAT(message("n\nendheader\ntime\ta\n1\t2\n0.5\t2\n"), StartsWith("a.sto:5: column \"time\" is 0.5 after 1"));
  EXPECT_THAT(message("n\nendheader\n"), HasSubstr("is empty"));
}

TEST(Table, SelectedColumnsMayStandBesideText) {
  const TemporaryFolder folder;
  const auto path = folder.write("a.csv", "time,activity,a\n0,walking,1\n1,,2\n");
  const Table table = readTable(path, {"a", "time"}, "s.yaml:3: k");
  EXPECT_THAT(table.columns, ElementsAre("a", "time"));
  EXPECT_THAT(table.data[0], ElementsAre(1, 2));
  EXPECT_THAT(messageOf([&] { readTable(path, {"tine"}, "s.yaml:3: k"); }),
              AllOf(StartsWith("s.yaml:3: k: "), HasSubstr("a.csv"), HasSubstr("unknown column \"tine\""),
                    HasSubstr("did you mean \"time\""), HasSubstr("known: time, activity, a")));
  EXPECT_THAT(messageOf([&] { readTable(path); }), HasSubstr(":2: column \"activity\" (2)"));
  EXPECT_THAT(messageOf([&] { readTable(folder.path() / "b.csv", {"a"}, "s.yaml:3: k"); }),
              AllOf(StartsWith("s.yaml:3: k: "), HasSubstr("not found")));
}

TEST(Table, StoRoundTripIsExact) {
  const TemporaryFolder folder;
  Table table;
  table.columns = {"time", "a b", "c"};
  table.data = {{0, 0.1, 1.0 / 3}, {1e-300, -2.5, 6.02e23}, {0.30000000000000004, -0.0, 5}};
  const auto path = folder.path() / "out.sto";
  writeSto(path, "motion", table, true, "made by a test\nsecond line");
  const Table back = readTable(path);
  EXPECT_EQ(back.columns, table.columns);
  EXPECT_EQ(back.data, table.data);
  EXPECT_TRUE(back.inDegrees);
  EXPECT_EQ(back.name, "motion");
  EXPECT_THAT(readFile(path),
              HasSubstr("nRows=3\nnColumns=3\ninDegrees=yes\nmade by a test\nsecond line\nendheader\n"));
  table.columns[0] = "t";
  EXPECT_THROW(writeSto(path, "motion", table, true), std::invalid_argument);
  table.columns[0] = "time";
  table.data[1].pop_back();
  EXPECT_THROW(writeSto(path, "motion", table, true), std::invalid_argument);
}

}  // namespace
}  // namespace genu::io
