/* A library with the functions of HncNetDll V1 and none of its code: fixed values of a mill that cuts, and faults on
 * purpose. The file named by FAKE_LIBRARY_FAULT holds "KIND FUNCTION [CODE]"; KIND is hang, abort, overrun, code, later
 * (1 = not there yet, with garbage in the buffer), slow (a dead link), lots (an absurd count), rest (HNC_ChannelGetValue:
 * no program runs) or deaf (HNC_RegSetValue: no rungs; no program runs either).
 * Compiled by the tests with the system's compiler. */
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <arpa/inet.h>
#include <sys/socket.h>

typedef int16_t Bit16;
typedef uint16_t uBit16;
typedef long Bit32;
typedef char Bit8;

static pthread_t owner;
static int listener = -1, initialised, connected, events, sampling, channels;
static Bit32 kinds[16], axes[16];
static int32_t registers[10][4096];
static struct timespec began;
static long delivered;

static void trigger(const char *wanted_kind, const char *function, int *hit, int *number) {
    char kind[32] = "", name[64] = "";
    const char *path = getenv("FAKE_LIBRARY_FAULT");
    FILE *file = path ? fopen(path, "r") : NULL;
    *hit = 0;
    if (!file) return;
    int fields = fscanf(file, "%31s %63s %d", kind, name, number);
    fclose(file);
    *hit = fields >= 2 && !strcmp(name, function) && !strcmp(kind, wanted_kind);
}

/* 0 go on, 1 return *code. */
static int fault(const char *function, void *out, size_t size, long *code) {
    int hit, number = 0;
    trigger("hang", function, &hit, &number);
    if (hit) for (;;) pause();
    trigger("abort", function, &hit, &number);
    if (hit) abort();
    trigger("slow", function, &hit, &number);
    if (hit) { usleep(3000000); *code = -1; return 1; }
    trigger("overrun", function, &hit, &number);
    if (hit && out) { memset(out, 0x5A, size + 1186); *code = 0; return 1; }
    trigger("later", function, &hit, &number);
    if (hit) { if (out) memset(out, 0x5A, size); *code = 1; return 1; }
    trigger("code", function, &hit, &number);
    if (hit) { if (out) memset(out, 0x5A, size); *code = number; return 1; }
    return 0;
}

#define CHECKED(out, size)                                         \
    do {                                                           \
        long code_;                                                \
        if (!initialised) return -10;                              \
        if (!pthread_equal(owner, pthread_self())) return -8;      \
        if (fault(__func__, (out), (size), &code_)) return code_;  \
    } while (0)

/* Opens a real listener: a second process on the same port gets 1009. */
Bit16 HNC_NetInit(const Bit8 *host, uBit16 port) {
    long code;
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons(port)};
    owner = pthread_self();
    if (fault(__func__, NULL, 0, &code)) return (Bit16)code;
    if (inet_pton(AF_INET, host, &at.sin_addr) != 1) return -1;
    listener = socket(AF_INET, SOCK_STREAM, 0);
    int on = 1;
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(listener, (struct sockaddr *)&at, sizeof at) || listen(listener, 4)) return 1009;
    initialised = 1;
    return 0;
}

void HNC_NetExit(void) {
    if (listener >= 0) close(listener);
    listener = -1;
    initialised = connected = 0;
}

Bit16 HNC_NetConnect(const Bit8 *host, uBit16 port) {
    CHECKED(NULL, 0);
    (void)host; (void)port;
    connected = 1;
    events = 1;
    return 3;
}

uBit16 HNC_NetIsConnect(Bit16 client) {
    CHECKED(NULL, 0);
    return client == 3 && connected ? 0 : 7;
}

/* src, code, 128 bytes; returns 0 when there was one. */
Bit32 HNC_EventGetSysEv(void *out) {
    CHECKED(out, 132);
    if (!events) return -1;
    events--;
    int16_t src = 0x400;
    uint16_t code = 0xA060;
    memcpy(out, &src, 2);
    memcpy((char *)out + 2, &code, 2);
    return 0;
}

static Bit32 whole(void *out, int32_t value) { memcpy(out, &value, 4); return 0; }
static Bit32 real(void *out, double value) { memcpy(out, &value, 8); return 0; }
static Bit32 text(void *out, const char *value) { strcpy(out, value); return 0; }

/* Between two programs? */
static int resting(void) {
    int rest, deaf, number = 0;
    trigger("rest", "HNC_ChannelGetValue", &rest, &number);
    trigger("deaf", "HNC_RegSetValue", &deaf, &number);
    return rest || deaf;
}

/* The rungs behind D110 to D117: a letter with a new number is taken between two programs. */
static void ladder(void) {
    int deaf, number = 0;
    int32_t *d = registers[6] + 110;
    trigger("deaf", "HNC_RegSetValue", &deaf, &number);
    if (deaf || !resting() || d[3] == d[7]) return;
    memcpy(d + 4, d, 4 * sizeof *d);
}

Bit32 HNC_SystemGetValue(Bit32 type, void *out, Bit16 client) {
    CHECKED(out, 48);
    switch (type) {
    case 1: return whole(out, 100000);
    case 24: return text(out, "2.31.03");
    case 25: return text(out, "SN848");
    }
    return -2;
}

Bit32 HNC_ChannelGetValue(Bit32 type, Bit32 ch, Bit32 index, void *out, Bit16 client) {
    CHECKED(out, 8);
    if (ch != 0) return -1;
    switch (type) {
    case 7: return real(out, 812.5);
    case 8: return real(out, 1000.0);
    case 9: return whole(out, registers[6][101] == 1 ? registers[6][100] : 80);
    case 14: return whole(out, 12);
    case 16: return whole(out, 1);
    case 17: case 19: case 22: case 23: case 25: case 26: return whole(out, 0);
    case 18: return whole(out, !resting());
    case 32: return whole(out, 340);
    case 36: return whole(out, 17);
    case 45: return whole(out, 5);
    case 47: return real(out, 3000.0);
    case 48: return real(out, 2987.25);
    case 49: return whole(out, 100);
    }
    return -2;
}

#ifndef WITHOUT_AXIS
Bit32 HNC_AxisGetValue(Bit32 type, Bit32 axis, void *out, Bit16 client) {
    CHECKED(out, 8);
    static const char *names[] = {"X", "Y", "Z", "", "", "C"};
    if (axis < 0 || axis > 5 || axis == 3 || axis == 4) return -1;
    switch (type) {
    case 0: return text(out, names[axis]);
    case 6: return whole(out, (int32_t)(-1234567 * (axis + 1)));
    case 18: return real(out, 100.5 * (double)axis);
    case 29: return real(out, 1.25 + (double)axis);
    }
    return -2;
}
#endif

Bit32 HNC_RegGetValue(Bit32 type, Bit32 index, void *out, Bit16 client) {
    CHECKED(out, 4);
    if (type < 0 || type > 8) return -1;
    if (index < 0 || index > 4095) return -2;
    ladder();
    return whole(out, registers[type][index]);
}

Bit32 HNC_RegSetValue(Bit32 type, Bit32 index, void *value, Bit16 client) {
    CHECKED(NULL, 0);
    if (type == 8) return -4;
    if (type < 0 || type > 8) return -1;
    if (index < 0 || index > 4095) return -2;
    memcpy(&registers[type][index], value, 4);
    return 0;
}

#ifndef WITHOUT_CRDS
/* The channel's external zero offset; the operator has set 40 um in Z. */
static int32_t zero[3] = {0, 0, 4000};
Bit32 HNC_CrdsGetValue(Bit32 type, Bit32 axis, void *out, Bit32 ch, Bit32 crds, Bit16 client) {
    CHECKED(out, 8);
    if (type != 9 || ch != 0 || axis < 0 || axis > 2) return -1;
    return whole(out, zero[axis]);
}
Bit32 HNC_CrdsSetValue(Bit32 type, Bit32 axis, void *value, Bit32 ch, Bit32 crds, Bit16 client) {
    CHECKED(NULL, 0);
    if (type != 9 || ch != 0 || axis < 0 || axis > 2 || !resting()) return -1;
    memcpy(&zero[axis], value, 4);
    return 0;
}
#endif

Bit32 HNC_FprogGetFullName(Bit32 ch, Bit8 *out, Bit16 client) {
    CHECKED(out, 60);
    return text(out, "../prog/O1234");
}

Bit32 HNC_AlarmGetNum(Bit32 type, Bit32 level, Bit32 *num, Bit16 client) {
    CHECKED(num, sizeof(Bit32));
    int hit, count = 0;
    trigger("lots", __func__, &hit, &count);
    return whole(num, hit ? count : access("/dev/null", F_OK) ? 0 : 1);
}

Bit32 HNC_AlarmGetData(Bit32 type, Bit32 level, Bit32 index, Bit32 *no, Bit8 *out, Bit16 client) {
    CHECKED(out, 64);
    whole(no, 1010101);
    return text(out, "\xbb\xfa\xb4\xb2\xc5\xdc\xb7\xc9\xb3\xb5");
}

Bit32 HNC_SamplSetChannel(Bit32 n, Bit16 client) { CHECKED(NULL, 0); channels = (int)n; return n < 0 || n > 16 ? -1 : 0; }
Bit32 HNC_SamplSetPropertyType(Bit32 ch, Bit32 type, Bit32 axis, Bit16 client) {
    CHECKED(NULL, 0);
    if (ch < 0 || ch >= channels || type >= 100) return -1;
    kinds[ch] = type;
    axes[ch] = axis;
    return 0;
}
Bit32 HNC_SamplSetRegType(Bit32 ch, Bit32 type, Bit32 offset, Bit32 len, Bit16 client) {
    CHECKED(NULL, 0);
    if (ch < 0 || ch >= channels || type < 100 || offset != 149) return -1;
    kinds[ch] = type;
    return 0;
}
Bit32 HNC_SamplSetPeriod(Bit32 ch, Bit32 tick, Bit16 client) { CHECKED(NULL, 0); return tick == 1 ? 0 : -1; }
Bit32 HNC_SamplSetLmt(Bit32 ch, Bit32 type, Bit32 n, Bit16 client) { CHECKED(NULL, 0); return type == 0 ? 0 : -1; }
Bit32 HNC_SamplReset(Bit16 client) { CHECKED(NULL, 0); sampling = 0; return 0; }
Bit32 HNC_SamplTriggerOn(Bit16 client) {
    CHECKED(NULL, 0);
    clock_gettime(CLOCK_MONOTONIC, &began);
    delivered = 0;
    sampling = 1;
    return 0;
}
Bit32 HNC_SamplTriggerOff(Bit16 client) { CHECKED(NULL, 0); sampling = 0; return 0; }
Bit32 HNC_SamplGetStat(Bit16 client) { CHECKED(NULL, 0); return sampling; }

/* A millisecond per value since the last fetch of channel 0; the counter wraps at 16 bits. */
Bit32 HNC_SamplGetData(Bit32 ch, Bit32 *num, Bit32 *out, Bit16 client) {
    static long first, last;
    CHECKED(out, (size_t)*num * sizeof(Bit32));
    int hit, count = 0;
    trigger("lots", __func__, &hit, &count);
    if (hit) { *num = count; return 0; }
    if (!sampling) return -1;
    if (ch == 0) {
        struct timespec now;
        clock_gettime(CLOCK_MONOTONIC, &now);
        long ms = (now.tv_sec - began.tv_sec) * 1000 + (now.tv_nsec - began.tv_nsec) / 1000000;
        first = delivered;
        last = ms - first > *num ? first + *num : ms;
        delivered = last;
    }
    for (long k = first; k < last; k++)
        out[k - first] = kinds[ch] >= 100 ? (65000 + k) % 65536 : kinds[ch] * 1000 + axes[ch];
    *num = last - first;
    return 0;
}
