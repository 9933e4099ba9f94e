# cairn: one Makefile. `make help` lists the targets. Everything is built under $(BUILD).
#
#   make BUILD=build/asan SANITIZE=1 test     a separate variant: address and undefined behaviour sanitizers
#   make BUILD=build/tsan SANITIZE=thread ... threads
#   make BUILD=build/clang CC=clang CXX=clang++ OPT=-O3

BUILD    ?= build
OPT      ?= -O2
HOST_OPT ?= $(OPT:-O2=-O3)
CFLAGS   ?=
CXXFLAGS ?= $(CFLAGS)
LDFLAGS  ?=
PREFIX   ?= /usr/local
LIBDIR   ?= $(PREFIX)/lib
DESTDIR  ?=
WERROR   ?=

# CROSS=x86_64-w64-mingw32-: for another system, with the compilers of that prefix (make windows).
CROSS ?=
ifneq ($(CROSS),)
CC  := $(CROSS)gcc
CXX := $(CROSS)g++
AR  := $(CROSS)ar
endif
WINDOWS := $(findstring mingw,$(CROSS))
EXE     := $(if $(WINDOWS),.exe)

version_part = $(shell awk '/define CAIRN_VERSION_$(1) /{print $$3}' include/cairn/version.h)
VERSION := $(call version_part,MAJOR).$(call version_part,MINOR).$(call version_part,PATCH)
SOVERSION := $(call version_part,MAJOR).$(call version_part,MINOR)

WARN     := -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wdouble-promotion -Wvla -Wundef -Wcast-align
# Formats there are checked by the rules of another C library than the one that prints, and isfinite() is no macro of the compiler.
WARN     += $(if $(WINDOWS),-Wno-format -Wno-float-conversion)
# A step must not be resumed behind the initialization of a variable (src/base/step.h); clang has no such warning.
JUMPS    := $(shell $(CC) -Werror -Wjump-misses-init -x c -c /dev/null -o /dev/null 2>/dev/null && echo -Wjump-misses-init)
CWARN    := $(WARN) -Wstrict-prototypes -Wmissing-prototypes $(JUMPS)
,        := ,
SAN       = $(if $(SANITIZE),-fsanitize=$(SANITIZE:1=address$(,)undefined) -fno-sanitize-recover=all -fno-omit-frame-pointer -g)
# Coverage of src/ only; tests and tools are compiled without it.
COVER     = $(if $(and $(COVERAGE),$(filter src/%,$<)),--coverage -O0)
COMMON    = $(OPT) -g -ffile-prefix-map=$(CURDIR)=. -I. -Iinclude -MMD -MP -ffp-contract=off -fPIC $(SAN) $(COVER)
# With assertions, undefined behaviour (an index out of bounds, an overflow) also ends the program by a trap, where the
# compiler needs no runtime library for it.
TRAPS     := $(if $(ASSERTIONS),$(if $(SANITIZE)$(COVERAGE),,$(shell t='-fsanitize=undefined -fsanitize-undefined-trap-on-error'; \
             $(CC) -Werror $$t -x c -c /dev/null -o /dev/null 2>/dev/null && echo "$$t")))
# The library itself is freestanding C11; all desktop code may use POSIX and is built with assertions. On desktops long loops
# over image planes (PLANES: the library's detection) are vectorized, with the same bits.
LIB_FLAGS  = -std=c11 $(CWARN) $(WERROR) $(COMMON) -fno-math-errno $(if $(ASSERTIONS),-DCAIRN_ASSERTIONS) $(TRAPS)
HOST_FLAGS = -std=c11 -D_POSIX_C_SOURCE=200809L -D_DEFAULT_SOURCE $(if $(WINDOWS),-D__USE_MINGW_ANSI_STDIO=1) $(CWARN) $(WERROR) $(COMMON) $(HOST_OPT) $(TRAPS)
# Tests are optimized less: they are compiled more often than they run.
TEST_OPT   = $(if $(filter tests/%,$<),$(if $(filter -O2 -O3,$(OPT)),-O1))
PLANES     = $(if $(filter src/detection/%,$<),$(HOST_OPT))
CXX_FLAGS  = -std=c++17 $(WARN) $(WERROR) $(COMMON) $(TRAPS)

# Modules. Box2D, libyaml, zlib, libpng, OpenCV and cmocka are searched in the Debian locations. A missing library disables
# what needs it (tools/deps.sh installs it): without zlib the host library is left out, without libyaml map files cannot be read,
# without libpng, libjpeg or libtiff PNG, JPEG or TIFF images cannot, without sqlite3, lz4, bzip2 or zstd bags that need them cannot (tools/deps.sh bags).
INCLUDES   := $(if $(CROSS),/usr/$(CROSS:-=)/include,/usr/include /usr/local/include /usr/include/$(shell $(CC) -print-multiarch 2>/dev/null))
has        = $(firstword $(wildcard $(addsuffix /$(1),$(INCLUDES))))
LIB_SRC     := $(wildcard src/*/*.c)
HAVE_HOST   := $(call has,zlib.h)
HAVE_YAML   := $(call has,yaml.h)
HAVE_PNG    := $(call has,png.h)
HAVE_JPEG   := $(call has,jpeglib.h)
HAVE_TIFF   := $(call has,tiffio.h)
HAVE_SIM    := $(call has,box2d/box2d.h)
HAVE_TEST   := $(call has,cmocka.h)
# Libraries for bags: header:library:macro, all optional.
BAG_KINDS   := sqlite3.h:sqlite3:CAIRN_HAVE_SQLITE lz4frame.h:lz4:CAIRN_HAVE_LZ4 bzlib.h:bz2:CAIRN_HAVE_BZ2 zstd.h:zstd:CAIRN_HAVE_ZSTD
BAG_FOUND   := $(foreach kind,$(BAG_KINDS),$(if $(call has,$(firstword $(subst :, ,$(kind)))),$(kind)))
BAG_LIBS    := $(foreach kind,$(BAG_FOUND),-l$(word 2,$(subst :, ,$(kind))))
BAG_DEFINES := $(foreach kind,$(BAG_FOUND),-D$(word 3,$(subst :, ,$(kind))))
BAG_MISSING := $(foreach kind,$(filter-out $(BAG_FOUND),$(BAG_KINDS)),lib$(word 2,$(subst :, ,$(kind))))
VISION_INC  := $(patsubst %/opencv2/imgcodecs.hpp,%,$(firstword $(call has,opencv4/opencv2/imgcodecs.hpp)))
HOST_OTHER  := src/host/files/map_file_$(if $(HAVE_YAML),no_)yaml.c src/host/bags/bag_file_$(if $(HAVE_YAML),no_yaml,folder).c \
               src/host/files/map_file_png$(if $(HAVE_PNG),_plain).c
HOST_SRC    := $(if $(HAVE_HOST),$(filter-out $(HOST_OTHER),$(wildcard src/host/*/*.c)) src/host/pictures/report_player_page.c)
VISION_SRC  := $(if $(VISION_INC),src/host/images/vision_shim.cpp)
APPEARANCE_SRC := $(if $(and $(VISION_INC),$(call has,opencv4/opencv2/features2d.hpp),$(call has,opencv4/opencv2/ml.hpp)),src/host/images/appearance_shim.cpp)
SIM_SRC     := $(if $(HAVE_SIM),$(wildcard sim/*.cpp))
TEST_LACKS  := $(if $(HAVE_SIM),,sim) $(if $(HAVE_HOST),,host) $(if $(HAVE_YAML),,yaml) $(if $(HAVE_PNG),,png)
TEST_SRC    := $(if $(HAVE_TEST),$(if $(strip $(TEST_LACKS)),$(shell sh tools/free-tests.sh $(TEST_LACKS)),$(wildcard tests/test_*.c)))
BENCH_SRC   := $(if $(and $(HAVE_SIM),$(HAVE_HOST)),$(filter-out bench/bench_%,$(wildcard bench/*.c)))
BENCH_COMMON := $(wildcard bench/bench_*.c) tools/options.c tools/cairn_places_picture.c firmware/joint.c
FW_ROBOT    := firmware/robot.c firmware/joint.c
FW_SURVEYOR := firmware/surveyor.c
CAIRN_SRC   := $(if $(HAVE_HOST),$(filter-out tools/cairn_arena% tools/cairn_scene%,$(wildcard tools/cairn*.c)) tools/options.c $(FW_ROBOT))
ARENA_SRC   := $(if $(and $(HAVE_SIM),$(HAVE_HOST)),$(wildcard tools/cairn_arena*.c) tools/options.c)
SCENE_SRC   := $(if $(HAVE_HOST),tools/cairn_scene.c tools/options.c sim/outlines.c bench/bench_scene.c)
TEST_COMMON := tests/support.c tests/rooms.c tests/kept.c bench/bench_bound.c bench/bench_score.c bench/bench_endless.c bench/bench_json.c $(FW_ROBOT) $(FW_SURVEYOR) firmware/recorder.c
# Additional sources of single tests: NEEDS_<test>.
GOLDEN      := $(wildcard tests/golden*.c)
NEEDS_test_golden := $(filter-out tests/golden.c,$(GOLDEN))
NEEDS_test_cairn_live := bench/bench_session.c
NEEDS_test_cairn_objects := tools/cairn_objects.c tools/cairn_picture.c tools/cairn_tool.c tools/options.c
NEEDS_test_memory := tools/pool_objects.c
NEEDS_test_object := tools/pool_objects.c
NEEDS_test_outlines := sim/outlines.c
NEEDS_test_long   := $(wildcard tests/long_*.c)
IMAGE_LIBS  := $(if $(HAVE_TIFF),-ltiff) $(if $(HAVE_JPEG),-ljpeg)
HOST_LIBS   := $(if $(HAVE_YAML),-lyaml) $(if $(HAVE_PNG),-lpng) $(IMAGE_LIBS) -lz $(if $(WINDOWS),-lpthread) $(BAG_LIBS)
SIM_LIBS    := -lbox2d
VISION_LIBS := -lopencv_imgcodecs -lopencv_imgproc -lopencv_core
APPEARANCE_LIBS := -lopencv_features2d -lopencv_ml -lopencv_core

object = $(patsubst %,$(BUILD)/$(1)/%.o,$(2))
LIBS     := $(BUILD)/libcairn.a $(BUILD)/libcairn-float.a $(if $(WINDOWS),,$(BUILD)/libcairn.so.$(SOVERSION)) \
            $(if $(HOST_SRC),$(BUILD)/libcairn-host.a) $(if $(VISION_SRC),$(BUILD)/libcairn-vision.so) $(if $(APPEARANCE_SRC),$(BUILD)/libcairn-appearance.so)
TOOLS    := $(if $(CAIRN_SRC),$(BUILD)/cairn$(EXE) $(BUILD)/cairn-float$(EXE)) $(if $(ARENA_SRC),$(BUILD)/cairn-arena) $(if $(SCENE_SRC),$(BUILD)/cairn-scene$(EXE))
# EXCEPT='test_long ...': all tests but these.
TESTS    := $(filter-out $(EXCEPT),$(TEST_SRC:tests/%.c=%))
BENCHES  := $(BENCH_SRC:bench/%.c=$(BUILD)/bench/%)

.PHONY: FORCE host-libraries all help code-objects unused-objects objects test run-tests golden run-golden demo run-demo bench run-bench vision appearance
.PHONY: python python-test python-bench python-ros python-notebooks python-check python-wheel
.PHONY: arduino packages-test man completion uninstall windows windows-test check check-long check-freestanding mutate amalgamation coverage
.PHONY: docs run-docs run-docs-test accuracy data run-data dist release-check abi thesis install install-strip clean format missing firmware run-firmware firmware-test run-firmware-test firmware-endless footprint
.DELETE_ON_ERROR:
.SECONDARY:

all: missing $(LIBS) $(TOOLS)

help:
	@echo "make                library, float library, host library, tools"
	@echo "make demo           arenas, their scans, maps (installs what it needs)"
	@echo "make test           all tests, double and float (installs what it needs)"
	@echo "make golden         renews the stored results of the tests (after an intended change)"
	@echo "make bench          the measuring programs, build/bench/*"
	@echo "make vision         libcairn-vision, which finds edges in images (installs OpenCV, some 130 packages)"
	@echo "make appearance     libcairn-appearance, appearance models of classes (installs OpenCV's features2d and ml)"
	@echo "make thesis         runs the experiments of the thesis, writes docs/thesis.md (DATA=FOLDER ITEMS='2/29 ...')"
	@echo "make accuracy       measures the figures of docs/accuracy.md, writes its tables (DATA=FOLDER ITEMS='...' QUICK=--quick)"
	@echo "make docs           the API reference as HTML, build/docs/html (installs Doxygen)"
	@echo "make check          warnings, formats, analyzers, API reference, freestanding proof, module order, words"
	@echo "make check-long     the slower checks that .ci/run leaves out; a release passes both"
	@echo "make mutate         plants faults in src/ and counts those that the tests find (N=40 SEED=1)"
	@echo "make firmware       the library in a robot's loop on Cortex-M7 and M4F"
	@echo "make firmware-test  runs it in an emulator and compares it with this machine, bit by bit"
	@echo "make footprint      writes docs/memory-and-time.md: stack, instructions, code and pool bytes"
	@echo "make firmware-endless LAPS=40  the same for the mapper, lap after lap"
	@echo "make data           makes the inputs under data/ again and compares them byte by byte"
	@echo "make amalgamation   cairn.c and cairn.h, two files to drop into a firmware project (MODULES=icp,mapper: these alone)"
	@echo "make arduino        a library of Arduino: build/arduino/cairn"
	@echo "make python         the Python package cairn2d, build/python; make python-test: its tests; python-ros: of the node; python-check: ruff and mypy; python-bench: its times"
	@echo "make python-notebooks  runs the notebooks, and compares them with docs/notebooks; DOCS=docs/notebooks: writes these"
	@echo "make packages-test  programs that use cairn by CMake, pkg-config, Conan and stand-ins of Zephyr, ESP-IDF and Arduino"
	@echo "make coverage       tests with line and branch coverage of src/"
	@echo "make dist           the sources of the last commit as a tarball; make python-wheel: sdist and wheel of the Python package, build/python/dist; ARCH=aarch64: a wheel for it, cross-built, build/python/dist-aarch64"
	@echo "make release-check  builds, tests and installs from that tarball, without git"
	@echo "make windows        cairn.exe, by the compilers of mingw-w64 (make windows-test: run under wine, and compared)"
	@echo "make abi            the binary interface of libcairn.so, recorded for make check (once, by a release)"
	@echo "make man            manual pages of all commands, build/man; make completion: of bash, zsh and fish, build/completion"
	@echo "make install        PREFIX=$(PREFIX) LIBDIR=$(LIBDIR) DESTDIR=$(DESTDIR); install-strip: without symbols; uninstall"

by_deps = $(if $(CROSS),, (tools/deps.sh $(1)))
missing:
	@$(if $(HAVE_HOST),:,echo "cairn: no zlib: libcairn-host and the tools are left out$(call by_deps,build)")
	@$(if $(HAVE_YAML),:,echo "cairn: no libyaml: map files are written$(,) but cannot be read$(call by_deps,build)")
	@$(if $(HAVE_PNG),:,echo "cairn: no libpng: PNG images are written$(,) but cannot be read$(call by_deps,build)")
	@$(if $(HAVE_JPEG),:,echo "cairn: no libjpeg: JPEG images cannot be read$(call by_deps,build)")
	@$(if $(HAVE_TIFF),:,echo "cairn: no libtiff: TIFF images cannot be read$(call by_deps,build)")
	@$(if $(and $(HAVE_HOST),$(strip $(BAG_MISSING))),echo "cairn: no $(strip $(BAG_MISSING)): bags that need it are refused$(call by_deps,bags)",:)
	@$(if $(HAVE_SIM),:,echo "cairn: no Box2D: sim and cairn-arena are left out$(call by_deps,build)")
	@$(if $(and $(HAVE_TEST),$(strip $(TEST_LACKS))),echo "cairn: tests that need what is missing are left out$(,) $(words $(TEST_SRC)) of $(words $(wildcard tests/test_*.c)) run",:)
	@$(if $(VISION_INC),:,echo "cairn: no OpenCV: libcairn-vision is left out$(,) edges and objects of photographs are not found$(call by_deps,vision)")
	@$(if $(APPEARANCE_SRC),:,echo "cairn: no features2d or ml of OpenCV: libcairn-appearance is left out, cairn train and --appearance do not work$(call by_deps,appearance)")

# Library objects, double and float.
$(BUILD)/double/src/%.c.o: src/%.c
	@mkdir -p $(@D)
	$(CC) $(if $(filter host/%,$*),$(HOST_FLAGS),$(LIB_FLAGS) $(PLANES)) $(CFLAGS) -c $< -o $@
$(BUILD)/float/src/%.c.o: src/%.c
	@mkdir -p $(@D)
	$(CC) -DCAIRN_FLOAT $(if $(filter host/%,$*),$(HOST_FLAGS),$(LIB_FLAGS) $(PLANES)) $(CFLAGS) -c $< -o $@
# What decompresses bags, and its test, are compiled again when one of the libraries comes or goes.
bag_objects := $(foreach real,double float,$(foreach file,src/host/bags/unpack src/host/bags/bag_file_sqlite tests/test_scan_log,$(BUILD)/$(real)/$(file).c.o))
$(bag_objects): $(BUILD)/bag-libraries.txt
$(bag_objects): HOST_FLAGS += $(BAG_DEFINES)
$(BUILD)/bag-libraries.txt: FORCE
	@mkdir -p $(@D); echo '$(BAG_LIBS)' | cmp -s - $@ || echo '$(BAG_LIBS)' >$@
# The decoders of images likewise.
image_objects := $(foreach real,double float,$(foreach file,jpeg tiff,$(BUILD)/$(real)/src/host/images/vision_$(file).c.o)) \
                 $(foreach real,double float,$(BUILD)/$(real)/tests/test_vision.c.o)
$(image_objects): $(BUILD)/image-libraries.txt
$(image_objects): HOST_FLAGS += $(if $(HAVE_JPEG),-DCAIRN_HAVE_JPEG) $(if $(HAVE_TIFF),-DCAIRN_HAVE_TIFF)
$(BUILD)/image-libraries.txt: FORCE
	@mkdir -p $(@D); echo '$(IMAGE_LIBS)' | cmp -s - $@ || echo '$(IMAGE_LIBS)' >$@
FORCE:
host-libraries:
	@echo '$(HOST_LIBS)'
# The page of the player is generated from its HTML.
$(BUILD)/src/host/pictures/report_player_page.c: src/host/pictures/report_player.html tools/page.sh
	@mkdir -p $(@D)
	sh tools/page.sh >$@.part && mv $@.part $@
$(BUILD)/%/src/host/pictures/report_player_page.c.o: $(BUILD)/src/host/pictures/report_player_page.c
	@mkdir -p $(@D)
	$(CC) $(if $(filter float,$*),-DCAIRN_FLOAT) $(HOST_FLAGS) $(CFLAGS) -c $< -o $@
# So is what the test of the open structs compares with: their layout in a program that has none of the build's flags. The test sees them
# as the library with assertions does.
layout_objects := $(BUILD)/double/tests/test_layout.c.o $(BUILD)/float/tests/test_layout.c.o
$(layout_objects): $(BUILD)/tests/layout.h
$(layout_objects): HOST_FLAGS += -I$(BUILD) -DCAIRN_ASSERTIONS
$(BUILD)/tests/layout.h: $(wildcard include/cairn/*.h) tools/layout.sh
	@mkdir -p $(@D)
	CC="$(CC)" sh tools/layout.sh >$@.part && mv $@.part $@
# And the comparisons of defaults and ranges with the comments of the headers.
comments_objects := $(BUILD)/double/tests/test_comments.c.o $(BUILD)/float/tests/test_comments.c.o
$(comments_objects): $(BUILD)/tests/comments.h
$(comments_objects): HOST_FLAGS += -I$(BUILD)
$(BUILD)/tests/comments.h: $(wildcard include/cairn/*.h src/*/*.c src/host/*/*.c) tools/modules.txt tools/docs-defaults.sh $(wildcard tools/docs*.awk)
	@mkdir -p $(@D)
	sh tools/docs-defaults.sh --source $(if $(HAVE_HOST),host) >$@.part && mv $@.part $@
# Everything else.
$(BUILD)/double/%.c.o: %.c
	@mkdir -p $(@D)
	$(CC) $(HOST_FLAGS) $(TEST_OPT) $(CFLAGS) -c $< -o $@
$(BUILD)/float/%.c.o: %.c
	@mkdir -p $(@D)
	$(CC) -DCAIRN_FLOAT $(HOST_FLAGS) $(TEST_OPT) $(CFLAGS) -c $< -o $@
$(BUILD)/double/%.cpp.o: %.cpp
	@mkdir -p $(@D)
	$(CXX) $(CXX_FLAGS) $(CXXFLAGS) -c $< -o $@
$(BUILD)/float/%.cpp.o: %.cpp
	@mkdir -p $(@D)
	$(CXX) -DCAIRN_FLOAT $(CXX_FLAGS) $(CXXFLAGS) -c $< -o $@

archive = @mkdir -p $(@D); rm -f $@; $(AR) rcs $@ $^
$(BUILD)/libcairn.a: $(call object,double,$(LIB_SRC))
	$(archive)
$(BUILD)/libcairn-float.a: $(call object,float,$(LIB_SRC))
	$(archive)
$(BUILD)/libcairn-host.a: $(call object,double,$(HOST_SRC))
	$(archive)
$(BUILD)/float/libcairn-host.a: $(call object,float,$(HOST_SRC))
	$(archive)
$(BUILD)/libcairn-sim.a: $(call object,double,$(SIM_SRC))
	$(archive)
$(BUILD)/float/libcairn-sim.a: $(call object,float,$(SIM_SRC))
	$(archive)
# The shared library exports what the public headers name, and nothing else.
$(BUILD)/libcairn.map: $(wildcard include/cairn/*.h)
	@mkdir -p $(@D)
	@{ echo '{ global:'; grep -ohE '\bcairn_[a-z0-9_]+\(' $^ | LC_ALL=C sort -u | tr '(' ';'; echo 'local: *; };'; } >$@
$(BUILD)/libcairn.so.$(SOVERSION): $(call object,double,$(LIB_SRC)) $(BUILD)/libcairn.map
	$(CC) -shared -Wl,-soname,$(@F) -Wl,--version-script=$(BUILD)/libcairn.map $(SAN) $(LDFLAGS) -o $@ $(filter %.o,$^) -lm

# Warnings are disabled for the headers of OpenCV.
$(BUILD)/double/src/host/images/vision_shim.cpp.o $(BUILD)/double/src/host/images/appearance_shim.cpp.o: CXXFLAGS += -isystem $(VISION_INC)
$(BUILD)/libcairn-vision.so: $(call object,double,$(VISION_SRC))
	$(CXX) -shared -Wl,-soname,$(@F) $(SAN) $(LDFLAGS) -o $@ $^ $(VISION_LIBS)
$(BUILD)/libcairn-appearance.so: $(call object,double,$(APPEARANCE_SRC))
	$(CXX) -shared -Wl,-soname,$(@F) $(SAN) $(LDFLAGS) -o $@ $^ $(APPEARANCE_LIBS)

# Tests and benches find the libraries that are loaded on demand in the folder above theirs.
$(BUILD)/tests/% $(BUILD)/tests-float/% $(BUILD)/bench/% $(BUILD)/bench-float/%: ABOVE = -Wl,--disable-new-dtags,-rpath,'$$ORIGIN/..'
link = @mkdir -p $(@D); $(CXX) $(SAN) $(if $(WINDOWS),,$(ABOVE)) $(if $(COVERAGE),--coverage) $(LDFLAGS) $(if $(WINDOWS),-static) -o $@ -Wl,--start-group $^ -Wl,--end-group
DOUBLE_LIBS := $(if $(SIM_SRC),$(BUILD)/libcairn-sim.a) $(if $(HOST_SRC),$(BUILD)/libcairn-host.a) $(BUILD)/libcairn.a
FLOAT_LIBS  := $(if $(SIM_SRC),$(BUILD)/float/libcairn-sim.a) $(if $(HOST_SRC),$(BUILD)/float/libcairn-host.a) $(BUILD)/libcairn-float.a
SYS_LIBS    = $(if $(SIM_SRC),$(SIM_LIBS)) $(if $(HOST_SRC),$(HOST_LIBS)) -lpthread -lm

$(BUILD)/cairn$(EXE): $(call object,double,$(CAIRN_SRC)) $(BUILD)/libcairn-host.a $(BUILD)/libcairn.a
	$(link) $(HOST_LIBS) -lm
$(BUILD)/cairn-float$(EXE): $(call object,float,$(CAIRN_SRC)) $(BUILD)/float/libcairn-host.a $(BUILD)/libcairn-float.a
	$(link) $(HOST_LIBS) -lm
$(BUILD)/cairn-arena: $(call object,double,$(ARENA_SRC)) $(DOUBLE_LIBS)
	$(link) $(SYS_LIBS)
$(BUILD)/cairn-scene$(EXE): $(call object,double,$(SCENE_SRC)) $(BUILD)/libcairn-host.a $(BUILD)/libcairn.a
	$(link) $(HOST_LIBS) -lm
$(BUILD)/bench/%: $(BUILD)/double/bench/%.c.o $(call object,double,$(BENCH_COMMON)) $(DOUBLE_LIBS)
	$(link) $(SYS_LIBS)
$(BUILD)/bench-float/%: $(BUILD)/float/bench/%.c.o $(call object,float,$(BENCH_COMMON)) $(FLOAT_LIBS)
	$(link) $(SYS_LIBS)
# In archives, so that a test is linked with what it uses alone.
$(BUILD)/libcairn-test.a: $(call object,double,$(TEST_COMMON))
	$(archive)
$(BUILD)/float/libcairn-test.a: $(call object,float,$(TEST_COMMON))
	$(archive)
$(BUILD)/tests/%: $(BUILD)/double/tests/%.c.o $(BUILD)/libcairn-test.a $(DOUBLE_LIBS)
	$(link) -lcmocka $(SYS_LIBS)
$(BUILD)/tests-float/%: $(BUILD)/float/tests/%.c.o $(BUILD)/float/libcairn-test.a $(FLOAT_LIBS)
	$(link) -lcmocka $(SYS_LIBS)
define test_needs
$(BUILD)/tests/$(1): $(call object,double,$(NEEDS_$(1)))
$(BUILD)/tests-float/$(1): $(call object,float,$(NEEDS_$(1)))
endef
$(foreach test,$(TESTS),$(if $(NEEDS_$(test)),$(eval $(call test_needs,$(test)))))

# For Windows, by the compilers of mingw-w64: build/windows/cairn.exe. windows-test runs it under wine and compares its files with
# those of this machine.
windows:
	@sh tools/deps.sh windows
	@$(MAKE) CROSS=x86_64-w64-mingw32- BUILD=$(BUILD)/windows all
windows-test:
	@sh tools/deps.sh build
	@$(MAKE) $(BUILD)/cairn
	@MAKE="$(MAKE)" sh tools/windows-test.sh $(BUILD)

# make test and make demo install missing dependencies, then run make again to detect them, on all processors unless -j is
# given.
PARALLEL = $(if $(filter -j% --jobserver%,$(MAKEFLAGS)),,-j$(shell nproc))
test:
	@sh tools/deps.sh build test
	@$(MAKE) $(PARALLEL) ASSERTIONS=1 BUILD=$(BUILD)/checked run-tests

# PRECISIONS=double: only the tests in double.
PRECISIONS ?= double float
# What these test computes in double: the simulation. EXCEPT_FLOAT='test_tools ...': these in double only, too.
DOUBLE_TESTS := test_arena test_hospital $(EXCEPT_FLOAT)
TEST_PROGRAMS = $(if $(filter double,$(PRECISIONS)),$(TESTS:%=$(BUILD)/tests/%)) \
                $(if $(filter float,$(PRECISIONS)),$(patsubst %,$(BUILD)/tests-float/%,$(filter-out $(DOUBLE_TESTS),$(TESTS))))
# Without tests in float the programs of float are not built.
TEST_TOOLS = $(if $(filter float,$(PRECISIONS)),$(LIBS) $(TOOLS),$(filter-out $(BUILD)/libcairn-float.a $(BUILD)/cairn-float,$(LIBS) $(TOOLS)))
run-tests: missing $(TEST_TOOLS) $(TEST_PROGRAMS)
	@SANITIZE=$(SANITIZE) sh tests/run.sh $(BUILD) $(TEST_PROGRAMS)

# Updates the stored results and pool sizes after an intended change (tests/kept.h).
KEPT = test_golden test_memory test_long
golden:
	@sh tools/deps.sh build test
	@$(MAKE) $(PARALLEL) ASSERTIONS=1 BUILD=$(BUILD)/checked run-golden
run-golden: $(KEPT:%=$(BUILD)/tests/%) $(KEPT:%=$(BUILD)/tests-float/%)
	@for program in $^; do $$program --renew >$$program.log 2>&1 || { grep -v "OK\|RUN" $$program.log; exit 1; }; done

demo:
	@sh tools/deps.sh build
	@$(MAKE) $(PARALLEL) run-demo
run-demo: all
	@sh tools/demo.sh $(BUILD)

bench:
	@sh tools/deps.sh build
	@$(MAKE) $(PARALLEL) run-bench
run-bench: all $(BENCHES)

vision:
	@sh tools/deps.sh build vision
	@$(MAKE) $(PARALLEL) $(BUILD)/libcairn-vision.so

appearance:
	@sh tools/deps.sh build vision appearance
	@$(MAKE) $(PARALLEL) $(BUILD)/libcairn-vision.so $(BUILD)/libcairn-appearance.so

# Repeats the experiments of the thesis: docs/thesis.md. DATA: the folder of the public data.
DATA ?= ../shared/data
thesis:
	@sh tools/deps.sh build vision appearance
	@$(MAKE) $(PARALLEL) run-bench
	@sh tools/measure.sh thesis $(BUILD) $(DATA) $(ITEMS)

# The files under data/, made again and compared: make data. tools/data.sh BUILD data writes them anew.
data:
	@sh tools/deps.sh build
	@$(MAKE) $(PARALLEL) run-data
run-data: all
	@$(MAKE) $(BUILD)/firmware/host/maze
	@rm -rf $(BUILD)/data && sh tools/data.sh $(BUILD) $(BUILD)/data && sh tools/data.sh --compare $(BUILD)/data data
	@sh tools/data.sh --try $(BUILD)

# The measured figures: docs/accuracy.md. QUICK=--quick: those that take seconds and need no data, compared only.
accuracy:
	@sh tools/deps.sh build vision appearance
	@$(MAKE) $(PARALLEL) run-bench
	@sh tools/measure.sh accuracy $(BUILD) $(DATA) $(QUICK) $(ITEMS)

# The API reference, from the comments of the headers; and whether the defaults that they say are those of the libraries.
docs:
	@sh tools/deps.sh build docs
	@$(MAKE) $(PARALLEL) run-docs
run-docs: $(BUILD)/libcairn.a $(if $(HOST_SRC),$(BUILD)/libcairn-host.a)
	@sh tools/docs.sh $(BUILD) && HOST_LIBS="$(HOST_LIBS)" sh tools/docs-defaults.sh $(BUILD)
run-docs-test: run-docs
	@HOST_LIBS="$(HOST_LIBS)" sh tools/docs-test.sh $(BUILD)

# QUICK=--quick: without the steps that take minutes.
check:
	@sh tools/deps.sh build test check docs
	@sh tools/check.sh $(BUILD) $(QUICK)

check-freestanding:
	@sh tools/check.sh $(BUILD) freestanding

# The sources of the last commit as a tarball, same commit, same bytes; and whether that alone builds, passes its tests and installs.
DIST := cairn-$(VERSION)
dist:
	@mkdir -p $(BUILD)
	git archive --format=tar --prefix=$(DIST)/ HEAD | gzip -n -9 >$(BUILD)/$(DIST).tar.gz.part && mv $(BUILD)/$(DIST).tar.gz.part $(BUILD)/$(DIST).tar.gz
release-check: dist
	@sh tools/deps.sh build test
	@MAKE="$(MAKE)" sh tools/release-check.sh $(BUILD)/$(DIST).tar.gz $(DIST)

# The record of the last release's binary interface, with which make check compares: made once, by a release.
ABI_RECORD := tools/libcairn-$(VERSION).abi.gz
abi: $(BUILD)/libcairn.so.$(SOVERSION)
	@sh tools/deps.sh check
	@[ ! -e $(ABI_RECORD) ] || { echo "make abi: $(ABI_RECORD) is there: expected a version without a record (docs/versions.md)"; exit 1; }
	@! grep -q '^## $(VERSION), in development' CHANGELOG.md || { echo "make abi: CHANGELOG.md says that $(VERSION) is in development, expected a release"; exit 1; }
	@sh tools/abi.sh $< >$(BUILD)/abi.part
	@rm -f tools/libcairn-*.abi.gz && mv $(BUILD)/abi.part $(ABI_RECORD)

check-long:
	@sh tools/deps.sh build test check docs
	@sh tools/check-long.sh $(BUILD)

# For the checks of warnings: what is built for use, and what is compiled for its warnings alone.
USED_SRC = $(LIB_SRC) $(HOST_SRC) $(if $(HAVE_YAML),src/host/files/map_file_no_yaml.c src/host/bags/bag_file_no_yaml.c) $(SIM_SRC) $(FW_LOOP) $(FW_SURVEY) $(DETECTORS:%=firmware/%.c) firmware/board_host.c $(CAIRN_SRC) $(ARENA_SRC) $(SCENE_SRC)
BENCH_ALL = $(filter-out $(USED_SRC),$(BENCH_SRC) $(BENCH_COMMON))
ALL_TEST_SRC = $(TEST_SRC) $(filter tests/%,$(TEST_COMMON)) $(GOLDEN) $(NEEDS_test_long) $(NEEDS_test_memory)
code-objects: $(call object,double,$(USED_SRC) $(BENCH_ALL) $(VISION_SRC) $(APPEARANCE_SRC)) $(call object,float,$(USED_SRC))
unused-objects: $(call object,double,$(ALL_TEST_SRC)) $(call object,float,$(ALL_TEST_SRC) $(BENCH_ALL))
objects: code-objects unused-objects

# The firmware: the float library in the loop of a robot on bare Cortex-M7 and M4F, and tests/golden.c in float and double.
FW        := $(BUILD)/firmware
FW_CC     := arm-none-eabi-gcc
FW_CPUS   := m7 m7d m4
fw_m7     := -mcpu=cortex-m7 -mfpu=fpv5-sp-d16
fw_m7d    := -mcpu=cortex-m7 -mfpu=fpv5-d16
fw_m4     := -mcpu=cortex-m4 -mfpu=fpv4-sp-d16
# Address of the external RAM of the emulated boards.
external_m7 := 0x60000000
external_m7d := $(external_m7)
external_m4 := 0x21000000
FW_FLAGS  := -std=c11 $(CWARN) $(WERROR) -Os -g -mthumb -mfloat-abi=hard -ffunction-sections -fdata-sections -fno-math-errno \
             -ffp-contract=off -I. -Iinclude -I$(FW) -MMD -MP
FW_DOUBLE := -Wl,--wrap=__aeabi_dadd,--wrap=__aeabi_dsub,--wrap=__aeabi_drsub
FW_LINK   := -nostartfiles -T firmware/cortex-m.ld -Wl,--gc-sections
MISSIONS  := $(patsubst firmware/mission_%.c,%,$(wildcard firmware/mission_*.c))
SURVEYS   := $(patsubst firmware/survey_%.c,%,$(wildcard firmware/survey_*.c))
FW_LOOP   := firmware/loop.c firmware/console.c $(FW_ROBOT) firmware/recorder.c
FW_SURVEY := firmware/loop_survey.c firmware/console.c $(FW_SURVEYOR)
DETECTORS := detector
# Double in software is emulated in minutes: only with SOFT_DOUBLE=1. QUICK: the M7 in float alone.
FW_FLOATS  := m7 $(if $(QUICK),,m4)
FW_DOUBLES := $(if $(QUICK),,m7d) $(if $(SOFT_DOUBLE),m7 m4)
FW_GOLDEN  := $(if $(strip $(FW_DOUBLES)),golden-double) golden-float
FW_ROBOTS  := $(SURVEYS) $(MISSIONS) $(DETECTORS)
FW_ELFS    := $(foreach cpu,$(FW_FLOATS),$(patsubst %,$(FW)/$(cpu)/%.elf,golden-float $(FW_ROBOTS))) $(FW_DOUBLES:%=$(FW)/%/golden-double.elf)
FW_HOST    := $(patsubst %,$(FW)/host/%,$(FW_GOLDEN) $(FW_ROBOTS))

# The scans of a mission or survey are made by cairn-arena and stored in the image as they come from the scanner.
SCANS_maze  := maze --places 16 --headings 1 --fov 360 --beams 181 --disturb 0.10,5
SCANS_arena := rescue --places 15 --headings 4 --disturb 0.10,5
SCANS_apartment := apartment --drive 150 --fov 240 --beams 241 --noise 0
$(FW)/%_scans.h: $(BUILD)/cairn-arena firmware/record.sh
	@mkdir -p $(@D)
	@$(BUILD)/cairn-arena $(SCANS_$*) --seed 7 -o $(FW)/$* >/dev/null
	sh firmware/record.sh $(FW)/$*/scans.log >$@.part && mv $@.part $@

# $(1) folder, $(2) compiler and flags, $(3) double or float
define fw_objects
$(FW)/$(1)/$(3)/%.c.o: %.c $(MISSIONS:%=$(FW)/%_scans.h) $(SURVEYS:%=$(FW)/%_scans.h)
	@mkdir -p $$(@D)
	$(2) $(if $(filter float,$(3)),-DCAIRN_FLOAT) -c $$< -o $$@
endef
$(foreach real,float double,$(foreach cpu,$(FW_CPUS),$(eval $(call fw_objects,$(cpu),$(FW_CC) $(FW_FLAGS) $(fw_$(cpu)) -fstack-usage -fcallgraph-info=su,$(real)))))
$(foreach real,float double,$(eval $(call fw_objects,host,$(CC) $(LIB_FLAGS) -I$(FW) $(CFLAGS),$(real))))
fw_object = $(patsubst %,$(FW)/$(1)/$(2)/%.o,$(3))
define fw_programs
$(FW)/$(1)/golden-float.elf: $(call fw_object,$(1),float,$(GOLDEN) firmware/board_cortex_m.c $(LIB_SRC)) firmware/cortex-m.ld
	$(FW_CC) $(FW_FLAGS) $(fw_$(1)) $(FW_LINK) -Wl,--defsym=ram_bytes=2M -Wl,--defsym=external_origin=$(external_$(1)) $$(filter %.o,$$^) -lm -o $$@
$(FW)/$(1)/golden-double.elf: $(call fw_object,$(1),double,$(GOLDEN) firmware/board_cortex_m.c firmware/soft_double.c $(LIB_SRC)) firmware/cortex-m.ld
	$(FW_CC) $(FW_FLAGS) $(fw_$(1)) $(FW_LINK) $(FW_DOUBLE) -Wl,--defsym=ram_bytes=2M -Wl,--defsym=external_origin=$(external_$(1)) $$(filter %.o,$$^) -lm -o $$@
$(SURVEYS:%=$(FW)/$(1)/%.elf): $(FW)/$(1)/%.elf: $(FW)/$(1)/float/firmware/survey_%.c.o $(call fw_object,$(1),float,$(FW_SURVEY) firmware/board_cortex_m.c $(LIB_SRC)) firmware/cortex-m.ld
	$(FW_CC) $(FW_FLAGS) $(fw_$(1)) $(FW_LINK) -Wl,--defsym=external_origin=$(external_$(1)) -Wl,-Map=$$@.map $$(filter %.o,$$^) -lm -o $$@
$(DETECTORS:%=$(FW)/$(1)/%.elf): $(FW)/$(1)/%.elf: $(FW)/$(1)/float/firmware/%.c.o $(call fw_object,$(1),float,firmware/console.c firmware/board_cortex_m.c $(LIB_SRC)) firmware/cortex-m.ld
	$(FW_CC) $(FW_FLAGS) $(fw_$(1)) $(FW_LINK) -Wl,--defsym=external_origin=$(external_$(1)) -Wl,-Map=$$@.map $$(filter %.o,$$^) -lm -o $$@
$(FW)/$(1)/%.elf: $(FW)/$(1)/float/firmware/mission_%.c.o $(call fw_object,$(1),float,$(FW_LOOP) firmware/board_cortex_m.c $(LIB_SRC)) firmware/cortex-m.ld
	$(FW_CC) $(FW_FLAGS) $(fw_$(1)) $(FW_LINK) -Wl,-Map=$$@.map $$(filter %.o,$$^) -lm -o $$@
endef
$(foreach cpu,$(FW_CPUS),$(eval $(call fw_programs,$(cpu))))
$(FW)/host/golden-float: $(call fw_object,host,float,$(GOLDEN) firmware/board_host.c) $(BUILD)/libcairn-float.a
	$(CC) $(SAN) $^ -lm -o $@
$(FW)/host/golden-double: $(call fw_object,host,double,$(GOLDEN) firmware/board_host.c) $(BUILD)/libcairn.a
	$(CC) $(SAN) $^ -lm -o $@
$(SURVEYS:%=$(FW)/host/%): $(FW)/host/%: $(FW)/host/float/firmware/survey_%.c.o $(call fw_object,host,float,$(FW_SURVEY) firmware/board_host.c) $(BUILD)/libcairn-float.a
	$(CC) $(SAN) $^ -lm -o $@
$(DETECTORS:%=$(FW)/host/%): $(FW)/host/%: $(FW)/host/float/firmware/%.c.o $(call fw_object,host,float,firmware/console.c firmware/board_host.c) $(BUILD)/libcairn-float.a
	$(CC) $(SAN) $^ -lm -o $@
$(FW)/host/%: $(FW)/host/float/firmware/mission_%.c.o $(call fw_object,host,float,$(FW_LOOP) firmware/board_host.c) $(BUILD)/libcairn-float.a
	$(CC) $(SAN) $^ -lm -o $@

firmware:
	@sh tools/deps.sh build firmware
	@$(MAKE) run-firmware
run-firmware: $(FW_ELFS)
firmware-test:
	@sh tools/deps.sh build firmware
	@$(MAKE) run-firmware-test
run-firmware-test: $(FW_ELFS) $(FW_HOST) $(TOOLS)
	@SOFT_DOUBLE=$(SOFT_DOUBLE) QUICK=$(QUICK) sh tools/firmware-test.sh $(FW) $(FW_GOLDEN) $(FW_ROBOTS)
firmware-endless: $(foreach cpu,m7 m4,$(SURVEYS:%=$(FW)/$(cpu)/%.elf)) $(SURVEYS:%=$(FW)/host/%) $(TOOLS)
	@LAPS=$(or $(LAPS),40) sh tools/firmware-test.sh $(FW) $(SURVEYS)
footprint:
	@sh tools/deps.sh build firmware
	@$(MAKE) run-firmware-test
	@sh tools/footprint.sh $(BUILD) docs/memory-and-time.md

mutate:
	@sh tools/deps.sh build test
	@sh tools/mutate.sh $(or $(N),40) $(or $(SEED),1)

format:
	clang-format -i $(wildcard src/*/*.[ch] src/host/*/*.[ch] include/cairn/*.h sim/*.cpp sim/*.h tools/*.[ch] tests/*.[ch] bench/*.[ch] firmware/*.[ch])

# MODULES=icp,mapper: only these modules and what they need.
amalgamation:
	sh tools/amalgamate.sh $(BUILD)/amalgamation $(subst $(,), ,$(MODULES))

# A library of Arduino, build/arduino/cairn.
arduino:
	sh tools/arduino.sh $(BUILD)/arduino/cairn $(subst $(,), ,$(MODULES))

coverage:
	@sh tools/deps.sh build test measure
	@rm -rf $(BUILD)/coverage
	@$(MAKE) $(PARALLEL) BUILD=$(BUILD)/coverage CC=gcc CXX=g++ COVERAGE=1 run-tests
	@sh tools/coverage.sh $(BUILD)/coverage

# Manual pages and completions of shells, from the option tables of the programs, so not when those are of another system.
PAGES     := $(if $(CROSS),,$(if $(CAIRN_SRC),$(BUILD)/option-tables.txt))
COMPLETION := $(BUILD)/completion/cairn.bash $(BUILD)/completion/_cairn $(BUILD)/completion/cairn.fish
$(BUILD)/option-tables.txt: $(TOOLS) tools/option-tables.sh
	@sh tools/option-tables.sh $(BUILD) >$@.part && mv $@.part $@
$(BUILD)/man/cairn.1: $(BUILD)/option-tables.txt tools/man.awk
	@rm -rf $(@D) && mkdir -p $(@D)
	awk -v folder=$(@D) -v version=$(VERSION) -f tools/man.awk $<
$(BUILD)/completion/cairn.bash: shell := bash
$(BUILD)/completion/_cairn: shell := zsh
$(BUILD)/completion/cairn.fish: shell := fish
$(COMPLETION): $(BUILD)/option-tables.txt $(wildcard tools/completion*.awk)
	@mkdir -p $(@D)
	awk -f tools/completion.awk -f tools/completion-$(shell).awk $< >$@.part && mv $@.part $@
man: $(BUILD)/man/cairn.1
completion: $(COMPLETION)

# Small programs that use cairn as a package: CMake, pkg-config, Conan.
packages-test: all
	@sh tools/deps.sh packages
	@MAKE="$(MAKE)" QUICK=$(QUICK) sh tools/packages-test.sh $(BUILD)

# The Python package, linked with the libraries of the build; PYTHON_TESTS='python/tests/test_package.py ...': these alone.
python_step = @CC="$(CC)" CXX="$(CXX)" MAKE="$(MAKE)" HOST_LIBS="$(HOST_LIBS)" SANITIZE="$(SANITIZE)" sh tools/python.sh $(BUILD)
python: all
	$(python_step) build
python-test: all
	$(python_step) test $(PYTHON_TESTS)
# RUNS=7: runs of each, whose medians are compared.
python-bench: all
	$(python_step) bench $(RUNS)
python-ros: all
	$(python_step) ros
python-notebooks: all
	$(python_step) notebooks $(DOCS)
python-check:
	$(python_step) check
python-wheel: $(if $(ARCH),all)
	$(python_step) wheel$(if $(ARCH),-$(ARCH))

install: all $(if $(PAGES),man completion)
	sh tools/install.sh "$(BUILD)" "$(DESTDIR)" "$(PREFIX)" "$(LIBDIR)" "$(VERSION)" "$(SOVERSION)" "$(strip $(HOST_LIBS))"
install-strip:
	@STRIP=-s $(MAKE) install

# What install would write is installed into the build folder, and each file of it is removed from its place.
uninstall:
	@rm -rf $(BUILD)/installed
	@$(MAKE) -s DESTDIR=$(abspath $(BUILD))/installed install >/dev/null
	@sh tools/uninstall.sh $(BUILD)/installed "$(DESTDIR)"

clean:
	rm -rf $(BUILD)

-include $(shell find $(BUILD)/double $(BUILD)/float $(FW) -name '*.d' 2>/dev/null)
