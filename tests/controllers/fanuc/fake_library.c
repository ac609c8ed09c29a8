/* A library with the vendor's functions and none of its code: fixed values of a lathe that cuts, and faults on purpose.
 * The file named by FAKE_LIBRARY_FAULT holds "KIND FUNCTION [CODE]"; KIND is hang, abort, overrun or code. "wait any MS"
 * makes every call that a real library sends take so long. The second path cuts at half the speed of the first.
 * FAKE_LIBRARY_FEED holds "DATA DECIMALS UNIT GROUP INCH": the feed of cnc_rdspeed, the modal group of feed per revolution,
 * and whether the machine measures in inches.
 * FAKE_LIBRARY_MODAL holds "DATA FLAG1 FLAG2": what cnc_modal says of the S word.
 * Compiled by the tests with the system's compiler. */
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int started;
static int16_t path_now = 1;
static pthread_t owner;
static int32_t macro_value = 254;
static int16_t macro_places = 1;
static uint8_t memory_r[1000];
static int feed_data = 240, feed_decimals, feed_unit, feed_group, inch;

/* 0 go on, 1 return *code. */
static int fault(const char *function, void *out, size_t size, int16_t *code) {
    char kind[32] = "", name[64] = "";
    int wanted = 0;
    const char *path = getenv("FAKE_LIBRARY_FAULT");
    FILE *file = path ? fopen(path, "r") : NULL;
    if (!file) return 0;
    int fields = fscanf(file, "%31s %63s %d", kind, name, &wanted);
    fclose(file);
    if (fields == 3 && !strcmp(kind, "wait")) usleep(1000 * (useconds_t)wanted);
    if (fields < 2 || strcmp(name, function) != 0) return 0;
    if (!strcmp(kind, "hang")) for (;;) pause();
    if (!strcmp(kind, "abort")) abort();
    if (!strcmp(kind, "overrun") && out) {
        memset(out, 0x5A, size + 1186);
        *code = 0;
        return 1;
    }
    if (!strcmp(kind, "code")) {
        if (out) memset(out, 0x5A, size);
        *code = (int16_t)wanted;
        return 1;
    }
    return 0;
}

#define CHECKED(out, size)                                      \
    do {                                                        \
        int16_t code_;                                          \
        if (!pthread_equal(owner, pthread_self())) return -8;   \
        if (fault(__func__, (out), (size), &code_)) return code_; \
    } while (0)

struct element { int32_t data; int16_t dec, unit; char name, suff1, suff2, reserve; };

int16_t cnc_startupprocess(int32_t level, const char *file) {
    (void)file;
    const char *feed = getenv("FAKE_LIBRARY_FEED");
    if (feed) sscanf(feed, "%d %d %d %d %d", &feed_data, &feed_decimals, &feed_unit, &feed_group, &inch);
    started = 1;
    return level > 3 ? 3 : 0;
}

int16_t cnc_exitprocess(void) { return 0; }

int16_t cnc_allclibhndl3(const char *host, uint16_t port, int32_t timeout, uint16_t *handle) {
    int16_t code;
    (void)host, (void)port, (void)timeout;
    if (!started) abort();
    puts("FOCAS2 log file is not found.");
    fflush(stdout);
    owner = pthread_self();
    if (fault(__func__, NULL, 0, &code)) return code;
    *handle = 32769;
    return 0;
}

int16_t cnc_freelibhndl(uint16_t handle) { return handle == 32769 ? 0 : -8; }
int16_t cnc_setpath(uint16_t handle, int16_t path) {
    (void)handle;
    if (path < 1 || path > 2) return 11;
    path_now = path;
    return 0;
}

int16_t cnc_getpath(uint16_t h, int16_t *path, int16_t *paths) {
    (void)h;
    *path = path_now;
    *paths = 2;
    return 0;
}

int16_t cnc_sysinfo(uint16_t h, void *out) {
    static const struct { int16_t add, axes_max; char text[14]; } values = {0x0402, 32, "31 TG42127.002"};
    (void)h;
    CHECKED(out, 18);
    memcpy(out, &values, 18);
    return 0;
}

int16_t cnc_statinfo(uint16_t h, int16_t *out) {
    static const int16_t values[9] = {0, 0, 1, 3, 1, 0, 0, 0, 0};
    (void)h;
    CHECKED(out, 18);
    memcpy(out, values, 18);
    return 0;
}

int16_t cnc_actf(uint16_t h, int32_t *out) {
    (void)h;
    CHECKED(out, 8);
    out[1] = 240 / path_now;
    return 0;
}

int16_t cnc_acts(uint16_t h, int32_t *out) {
    (void)h;
    CHECKED(out, 8);
    out[1] = 1200 / path_now;
    return 0;
}

int16_t cnc_rdspeed(uint16_t h, int16_t kind, void *out) {
    struct { int32_t data; int16_t dec, unit, disp; char name, suff; } values[2] = {
        {feed_data / path_now, (int16_t)feed_decimals, (int16_t)feed_unit, 1, 'F', 0},
        {1200 / path_now, 0, 2, 1, 'S', '1'},
    };
    (void)h;
    CHECKED(out, 24);
    memcpy(out, values, kind == 0 ? 12 : 24);
    return 0;
}

int16_t cnc_rdspmeter(uint16_t h, int16_t kind, int16_t *count, struct element *out) {
    (void)h;
    CHECKED(out, 24);
    *count = 1;
    if (kind != 1) out[0] = (struct element){41, 0, 0, 'S', '1', 0, 0};
    if (kind != 0) out[1] = (struct element){1200, 0, 1, 'S', '1', 0, 0};
    return 0;
}

int16_t cnc_rdspgear(uint16_t h, int16_t spindle, int16_t *out) {
    (void)h, (void)spindle;
    CHECKED(out, 20);
    out[2] = 2;
    return 0;
}

#ifndef WITHOUT_SERVO_METER
int16_t cnc_rdsvmeter(uint16_t h, int16_t *count, struct element *out) {
    (void)h;
    CHECKED(out, 24);
    *count = 2;
    out[0] = (struct element){0, 0, 0, 'X', 0, 0, 0};
    out[1] = (struct element){17, 0, 0, 'Z', 0, 0, 0};
    return 0;
}
#endif

int16_t cnc_exeprgname(uint16_t h, char *out) {
    int32_t number = 1000 * path_now + 1;
    (void)h;
    CHECKED(out, 40);
    strcpy(out, path_now == 1 ? "O1001" : "O2001");
    memcpy(out + 36, &number, 4);
    return 0;
}

int16_t cnc_rdprgnum(uint16_t h, int16_t *out) {
    (void)h;
    CHECKED(out, 8);
    out[2] = out[3] = 1001;
    return 0;
}

int16_t cnc_rdseqnum(uint16_t h, int32_t *out) {
    (void)h;
    CHECKED(out, 8);
    out[1] = 120;
    return 0;
}

int16_t cnc_rddynamic2(uint16_t h, int16_t axis, int16_t length, int32_t *out) {
    (void)h, (void)axis;
    CHECKED(out, 540);
    if (length != 540) return 2;
    out[2] = out[3] = 1000 * path_now + 1;
    out[4] = 120;
    out[5] = 240 / path_now;
    out[6] = 1200 / path_now;
    out[7 + 32] = 79000;
    out[7 + 33] = -12345;
    return 0;
}

int16_t cnc_getfigure(uint16_t h, int16_t kind, int16_t *count, int16_t *in, int16_t *out) {
    (void)h, (void)kind;
    CHECKED(out, 64);
    *count = 2;
    in[0] = in[1] = out[0] = out[1] = 3;
    return 0;
}

int16_t cnc_modal(uint16_t h, int16_t kind, int16_t block, int32_t *out) {
    (void)h, (void)block;
    CHECKED(out, 260);
    if (kind < 100) {
        ((uint8_t *)out)[4] = kind == 4 ? (uint8_t)feed_group : 0;
        return 0;
    }
    const char *modal = getenv("FAKE_LIBRARY_MODAL");
    int data, flag1, flag2;
    if (modal && kind == 107 && sscanf(modal, "%d %d %d", &data, &flag1, &flag2) == 3) {
        out[1] = data;
        ((uint8_t *)out)[8] = (uint8_t)flag1;
        ((uint8_t *)out)[9] = (uint8_t)flag2;
        return 0;
    }
    out[1] = kind == 103 ? 250 / path_now : kind == 107 ? 1200 / path_now : kind == 108 ? 303 : 0;
    return 0;
}

int16_t cnc_rdmacro(uint16_t h, int16_t number, int16_t length, char *out) {
    (void)h, (void)number, (void)length;
    CHECKED(out, 10);
    memcpy(out + 4, &macro_value, 4);
    memcpy(out + 8, &macro_places, 2);
    return 0;
}

int16_t cnc_wrmacro(uint16_t h, int16_t number, int16_t length, int32_t value, int16_t places) {
    (void)h, (void)number, (void)length;
    CHECKED(NULL, 0);
    macro_value = value;
    macro_places = places;
    return 0;
}

int16_t cnc_rdparam(uint16_t h, int16_t number, int16_t axis, int16_t length, int32_t *out) {
    (void)h, (void)axis;
    CHECKED(out, 12);
    if (number == 6711 && length < 8) return 2;
    out[1] = number == 6711 ? 17 : number == 1001 ? inch : 0;
    return 0;
}

int16_t pmc_rdpmcrng(uint16_t h, int16_t area, int16_t width, uint16_t from, uint16_t to, uint16_t length, uint8_t *out) {
    (void)h, (void)width;
    CHECKED(out, length);
    if (to < from || length != 8 + to - from + 1) return 2;
    for (uint16_t at = from; at <= to; at++) {
        uint8_t value = 0;
        if (area == 0) value = at % 1000 == 12 ? 0xAF : at % 1000 == 30 ? 100 : 0;
        if (area == 1) value = at % 1000 == 0 ? 0x60 : 0;
        if (area == 5 && at < sizeof memory_r) value = memory_r[at];
        out[8 + at - from] = value;
    }
    return 0;
}

int16_t pmc_wrpmcrng(uint16_t h, uint16_t length, const uint8_t *values) {
    uint16_t area, from, to;
    (void)h;
    CHECKED(NULL, 0);
    memcpy(&area, values, 2), memcpy(&from, values + 4, 2), memcpy(&to, values + 6, 2);
    if (area != 5 || to >= sizeof memory_r || length != 8 + to - from + 1) return 3;
    memcpy(memory_r + from, values + 8, (size_t)(to - from) + 1);
    return 0;
}
