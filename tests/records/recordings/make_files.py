#!/usr/bin/env python3
"""Writes one recording the way loggers, offices and laboratories write it, with programs of others where there are any:
openpyxl, xlwt, odfpy, pandas, scipy, npTDMS, pyarrow; R, Octave and LibreOffice where they are installed.

    python3 make_files.py DIRECTORY      (pandas openpyxl xlwt odfpy scipy npTDMS pyarrow msoffcrypto-tool)

A lathe: 8 runs of 80 s at 1 Hz; the spindle takes 150 W more while the coolant pump is on. Every file holds the same rows,
or says in TRUTH (table.json) what it lacks. The files in tests/data/foreign were written by this script.
"""
import datetime as dt
import gzip
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile

OUT = sys.argv[1]
os.makedirs(OUT, exist_ok=True)
random.seed(47)
START = dt.datetime(2026, 11, 26, 14, 3, 1, 250000)

ROWS = []
for run in range(8):
    for k in range(80):
        n = [800, 1200, 1600, 2000][k // 20]
        engaged = 1 if k % 20 >= 6 else 0
        coolant = 1 if (run * 80 + k) // 35 % 2 else 0
        ap, d, f = 1.5, 60.0, 0.2
        vc = math.pi * d * n / 1000
        power = 120 + 0.22 * n + 2.5e-5 * n * n + engaged * 1800 * ap * f ** (1 - 0.23) * vc / 60 + 150 * coolant
        power += random.gauss(0, 8)
        ROWS.append(dict(t=run * 80 + k, run=f"r{run + 1}", n=n, vf=round(n * f, 1), ap=ap, d=d, engaged=engaged,
                         coolant=coolant, p=round(power, 1)))
COLS = ["run", "n", "vf", "ap", "d", "engaged", "coolant", "p"]
TRUTH = {}


def truth(name, columns=None, refused=None, start=True, note=""):
    """What a reader must find: the columns (as in COLS), or the word that the refusal must hold."""
    TRUTH[name] = dict(columns=columns if columns is not None else COLS, refused=refused, start=start, note=note)


def put(name, text, encoding="utf-8", newline="\r\n"):
    with open(os.path.join(OUT, name), "wb") as file:
        file.write(text.replace("\n", newline).encode(encoding))


def stamp(row):
    return START + dt.timedelta(seconds=row["t"])


def comma(x, digits=None):
    return (f"{x:.{digits}f}" if digits is not None else str(x)).replace(".", ",")


# ---- the clean file
put("clean.csv", "time_utc,run,spindle_speed_rpm,feed_mm_min,depth_of_cut_mm,diameter_mm,engaged,coolant_on,spindle_power_w\n"
    + "".join(f"{(stamp(r) - dt.timedelta(hours=1)).isoformat(timespec='milliseconds')}Z,{r['run']},{r['n']},{r['vf']},{r['ap']},{r['d']},{r['engaged']},{r['coolant']},{r['p']}\n" for r in ROWS), newline="\n")

# ---- Excel, German and Chinese
DE = ["Zeit", "Lauf", "Drehzahl [1/min]", "Vorschub [mm/min]", "Schnitttiefe [mm]", "Durchmesser [mm]", "Eingriff", "Kühlmittel", "Spindelleistung [kW]"]
ZH = ["时间", "批次", "主轴转速(rpm)", "进给速度(mm/min)", "切深(mm)", "直径(mm)", "切削", "冷却液", "主轴功率(W)"]


def cells(r, kilo=False):
    return [r["run"], r["n"], r["vf"], r["ap"], r["d"], r["engaged"], r["coolant"], r["p"] / 1000 if kilo else r["p"]]


import openpyxl

book = openpyxl.Workbook()
sheet = book.active
sheet.title = "Messung"
sheet.append(DE)
for r in ROWS:
    sheet.append([stamp(r)] + cells(r, True))
book.save(f"{OUT}/excel_de.xlsx")
truth("excel_de.xlsx")

book = openpyxl.Workbook()
sheet = book.active
sheet.title = "数据"
sheet.append(ZH)
for r in ROWS:
    sheet.append([stamp(r)] + cells(r))
book.save(f"{OUT}/excel_zh.xlsx")
truth("excel_zh.xlsx")

book = openpyxl.Workbook()
cover = book.active
cover.title = "Deckblatt"
cover.append(["Prüfbericht", "Drehmaschine CK6136"])
cover.append(["Prüfer", "M. Huber"])
sheet = book.create_sheet("Daten")
sheet.append(["Messreihe 7", None, None])
sheet.append([None])
sheet.append([h.split(" [")[0] for h in DE])
sheet.append(["", "", "1/min", "mm/min", "mm", "mm", "", "", "kW"])
for r in ROWS:
    sheet.append([stamp(r)] + cells(r, True))
sheet.append(["Mittelwert", None, None, None, None, None, None, None, sum(r["p"] for r in ROWS) / len(ROWS) / 1000])
sheet.append(["Maximum", None, None, None, None, None, None, None, max(r["p"] for r in ROWS) / 1000])
book.save(f"{OUT}/excel_cover_units_footer.xlsx")
truth("excel_cover_units_footer.xlsx")

book = openpyxl.Workbook()
sheet = book.active
sheet.append(DE)
for r in ROWS:
    sheet.append([stamp(r).strftime("%d.%m.%Y %H:%M:%S,%f")[:-3]] + [comma(x) for x in cells(r, True)])
book.save(f"{OUT}/excel_numbers_as_text.xlsx")
truth("excel_numbers_as_text.xlsx")

book = openpyxl.Workbook()
sheet = book.active
sheet.append(["Datum", "Uhrzeit"] + DE[1:])
for r in ROWS:
    sheet.append([stamp(r).date(), stamp(r).time()] + cells(r, True))
book.save(f"{OUT}/excel_date_and_time.xlsx")
truth("excel_date_and_time.xlsx")

book = openpyxl.Workbook()
sheet = book.active
sheet.append(["Uhrzeit"] + DE[1:])
for r in ROWS:
    sheet.append([stamp(r).time()] + cells(r, True))
book.save(f"{OUT}/excel_time_of_day.xlsx")
truth("excel_time_of_day.xlsx", start=False)

book = openpyxl.Workbook()
sheet = book.active
sheet.append(["Zeit"] + DE[1:])
for r in ROWS:
    sheet.append([dt.timedelta(seconds=r["t"])] + cells(r, True))
book.save(f"{OUT}/excel_duration.xlsx")
truth("excel_duration.xlsx", start=False)

import xlwt

book = xlwt.Workbook(encoding="gbk")
sheet = book.add_sheet("数据")
style = xlwt.easyxf(num_format_str="YYYY-MM-DD HH:MM:SS.000")
for column, head in enumerate(ZH):
    sheet.write(0, column, head)
for index, r in enumerate(ROWS):
    sheet.write(index + 1, 0, stamp(r), style)
    for column, value in enumerate(cells(r)):
        sheet.write(index + 1, column + 1, value)
book.save(f"{OUT}/excel_zh.xls")
truth("excel_zh.xls")

put("excel_de.csv", ";".join(DE) + "\n" + "".join(
    ";".join([stamp(r).strftime("%d.%m.%Y %H:%M:%S,%f")[:-3]] + [comma(x) for x in cells(r, True)]) + "\n" for r in ROWS), "cp1252")
truth("excel_de.csv")
put("excel_zh_gbk.csv", ",".join(ZH) + "\n" + "".join(
    ",".join([stamp(r).strftime("%Y/%m/%d %H:%M:%S.%f")[:-3]] + [str(x) for x in cells(r)]) + "\n" for r in ROWS), "gbk")
truth("excel_zh_gbk.csv")
put("excel_zh_date_in_characters.csv", ",".join(ZH) + "\n" + "".join(
    ",".join([stamp(r).strftime("%Y年%m月%d日 %H时%M分%S秒")] + [str(x) for x in cells(r)]) + "\n" for r in ROWS), "gb18030")
truth("excel_zh_date_in_characters.csv", note="whole seconds")
put("excel_serial.csv", "Date,Speed (rpm),Feed (mm/min),Depth of cut (mm),Diameter (mm),Engaged,Coolant,Spindle power (W)\n" + "".join(
    ",".join([f"{(stamp(r) - dt.datetime(1899, 12, 30)) / dt.timedelta(days=1):.8f}"] + [str(x) for x in cells(r)[1:]]) + "\n" for r in ROWS))
truth("excel_serial.csv", COLS[1:])
put("excel_us.csv", "sep=,\nTimestamp,Run,Spindle Speed (RPM),Feed (in/min),Depth of Cut (in),Diameter (in),Engaged,Coolant,Spindle Power (W)\n" + "".join(
    ",".join([stamp(r).strftime("%m/%d/%Y %I:%M:%S %p"), r["run"], f"\"{r['n']:,}\"", f"{r['vf'] / 25.4:.6f}", f"{r['ap'] / 25.4:.8f}", f"{r['d'] / 25.4:.8f}", "Y" if r["engaged"] else "N", "TRUE" if r["coolant"] else "FALSE", f"\"{r['p']:,.1f}\""]) + "\n" for r in ROWS))
truth("excel_us.csv", note="whole seconds")
put("excel_swiss.csv", ";".join(DE) + "\n" + "".join(
    ";".join([stamp(r).strftime("%d.%m.%Y %H:%M:%S.%f")[:-3], r["run"], f"{r['n']:,}".replace(",", "'"), str(r["vf"]), str(r["ap"]), str(r["d"]), "ja" if r["engaged"] else "nein", "ein" if r["coolant"] else "aus", f"{r['p'] / 1000:.4f}"]) + "\n" for r in ROWS), "utf-8-sig")
truth("excel_swiss.csv")
put("excel_thousands_de.csv", ";".join(DE[:-1] + ["Spindelleistung [W]"]) + "\n" + "".join(
    ";".join([stamp(r).strftime("%d.%m.%Y %H:%M:%S,%f")[:-3], r["run"], f"{r['n']:,}".replace(",", "."), comma(r["vf"]), comma(r["ap"]), comma(r["d"]), str(r["engaged"]), str(r["coolant"]), f"{r['p']:,.1f}".translate(str.maketrans(",.", ".,"))]) + "\n" for r in ROWS), "cp1252")
truth("excel_thousands_de.csv")

book = openpyxl.load_workbook(f"{OUT}/excel_de.xlsx")
import msoffcrypto

with open(f"{OUT}/excel_de.xlsx", "rb") as plain, open(f"{OUT}/excel_password.xlsx", "wb") as locked:
    msoffcrypto.OfficeFile(plain).encrypt("secret", locked)
truth("excel_password.xlsx", refused="password")

# ---- OpenDocument
from odf.opendocument import OpenDocumentSpreadsheet
from odf.table import Table, TableCell, TableRow
from odf.text import P

document = OpenDocumentSpreadsheet()
table = Table(name="Tabelle1")


def ods_row(values):
    line = TableRow()
    for value in values:
        if isinstance(value, (int, float)):
            cell = TableCell(valuetype="float", value=str(value))
        elif isinstance(value, dt.datetime):
            cell = TableCell(valuetype="date", datevalue=value.isoformat(timespec="milliseconds"))
        else:
            cell = TableCell(valuetype="string")
        cell.addElement(P(text=str(value)))
        line.addElement(cell)
    table.addElement(line)


ods_row(DE)
for r in ROWS:
    ods_row([stamp(r)] + cells(r, True))
document.spreadsheet.addElement(table)
document.save(f"{OUT}/calc_de.ods")
truth("calc_de.ods")

# ---- LabVIEW
LVM = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t{dec}\nMulti_Headings\t{multi}\nX_Columns\t{x}\nTime_Pref\t{pref}\nOperator\tlab\nDate\t2026/11/26\nTime\t14:03:01{dec}2500000\n***End_of_Header***\t\n\t\n"
CH = ["Drehzahl", "Vorschub", "Schnitttiefe", "Durchmesser", "Eingriff", "Kuehlmittel", "Spindelleistung"]
UNIT = ["1/min", "mm/min", "mm", "mm", "", "", "W"]


def lvm(dec, x_columns):
    d = lambda value: f"{value:.6f}".replace(".", dec)
    text = LVM.format(dec=dec, multi="Yes", x=x_columns, pref="Relative")
    text += "Channels\t7\t\t\t\t\t\t\nSamples\t" + "\t".join([str(len(ROWS))] * 7) + "\t\n"
    text += "Date\t" + "\t".join(["2026/11/26"] * 7) + "\t\nTime\t" + "\t".join([f"14:03:01{dec}25"] * 7) + "\t\n"
    text += "Y_Unit_Label\t" + "\t".join(UNIT) + "\t\nX_Dimension\t" + "\t".join(["Time"] * 7) + "\t\n"
    text += "X0\t" + "\t".join([d(0) + "E+0"] * 7) + "\t\nDelta_X\t" + "\t".join([d(1)] * 7) + "\t\n***End_of_Header***\t\t\t\t\t\t\t\n"
    if x_columns == "Multi":
        text += "\t".join(f"X_Value\t{name}" for name in CH) + "\tComment\n"
    else:
        text += "X_Value\t" + "\t".join(CH) + "\tComment\n"
    for r in ROWS:
        values = [r["n"], r["vf"], r["ap"], r["d"], r["engaged"], r["coolant"], r["p"]]
        if x_columns == "One":
            text += d(r["t"]) + "\t" + "\t".join(d(v) for v in values) + "\n"
        elif x_columns == "No":
            text += "\t" + "\t".join(d(v) for v in values) + "\n"
        else:
            text += "\t".join(d(r["t"]) + "\t" + d(v) for v in values) + "\n"
    return text


put("labview_one.lvm", lvm(".", "One"), "cp1252")
put("labview_no_x_de.lvm", lvm(",", "No"), "cp1252")
put("labview_multi.lvm", lvm(",", "Multi"), "cp1252")
for name in ["labview_one.lvm", "labview_no_x_de.lvm", "labview_multi.lvm"]:
    truth(name, COLS[1:])

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

utc = (START - dt.timedelta(hours=1)).replace(tzinfo=dt.timezone.utc)
with TdmsWriter(f"{OUT}/labview.tdms") as writer:
    head = [RootObject(properties={"Author": "lab"}), GroupObject("Messung")]
    keys = ["n", "vf", "ap", "d", "engaged", "coolant", "p"]
    for half in (ROWS[:320], ROWS[320:]):
        writer.write_segment(head + [
            ChannelObject("Messung", name, np.array([float(r[key]) for r in half]),
                          properties={"unit_string": unit, "wf_increment": 1.0, "wf_start_offset": 0.0, "wf_start_time": np.datetime64(utc.replace(tzinfo=None))})
            for name, unit, key in zip(CH, UNIT, keys)])
        head = []
truth("labview.tdms", COLS[1:])

with TdmsWriter(f"{OUT}/labview_time_channel.tdms") as writer:
    times = np.array([np.datetime64((stamp(r) - dt.timedelta(hours=1))) for r in ROWS])
    writer.write_segment([RootObject(), GroupObject("Log"), ChannelObject("Log", "Timestamp", times)] + [
        ChannelObject("Log", f"{name} [{unit}]" if unit else name, np.array([float(r[key]) for r in ROWS], dtype=np.float32 if key != "n" else np.int32))
        for name, unit, key in zip(CH, UNIT, keys)])
truth("labview_time_channel.tdms", COLS[1:], note="single precision")

# ---- MATLAB
import scipy.io

column = lambda key: np.array([[float(r[key])] for r in ROWS])
names = dict(time_s="t", spindle_speed_rpm="n", feed_mm_min="vf", depth_of_cut_mm="ap", diameter_mm="d", engaged="engaged", coolant_on="coolant", spindle_power_w="p")
scipy.io.savemat(f"{OUT}/matlab_v5.mat", {name: column(key) for name, key in names.items()})
scipy.io.savemat(f"{OUT}/matlab_v5_compressed_struct.mat", {"data": {name: column(key) for name, key in names.items()}}, do_compression=True)
scipy.io.savemat(f"{OUT}/matlab_v4.mat", {name: column(key) for name, key in names.items()}, format="4")
for name in ["matlab_v5.mat", "matlab_v5_compressed_struct.mat", "matlab_v4.mat"]:
    truth(name, COLS[1:], start=False)
put("matlab_writetimetable.csv", "Time,SpindleSpeed_rpm,Feed_mm_min,DepthOfCut_mm,Diameter_mm,Engaged,Coolant,SpindlePower_W\n" + "".join(
    f"{r['t']} sec,{r['n']},{r['vf']},{r['ap']},{r['d']},{r['engaged']},{r['coolant']},{r['p']}\n" for r in ROWS))
truth("matlab_writetimetable.csv", COLS[1:], start=False)
try:
    import h5py

    with h5py.File(f"{OUT}/matlab_v73.mat", "w", userblock_size=512) as file:
        file["p"] = column("p")
    with open(f"{OUT}/matlab_v73.mat", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Thu Nov 26 14:03:01 2026 HDF5 schema 1.00 .".ljust(116) + b"\0" * 8 + b"\x00\x02IM")
    truth("matlab_v73.mat", refused="7.3")
except ImportError:
    pass

# ---- oscilloscopes, power meters
put("picoscope.csv", "Time,Channel A,Channel B,Channel C\n(ms),(rpm),(W),(V)\n\n" + "".join(
    f"{r['t'] * 1000:.5f},{r['n']:.4f},{r['p']:.4f},{'∞' if r['t'] == 100 else '0.01'}\n" for r in ROWS))
truth("picoscope.csv", refused="spindle_power_w", note="Channel B says nothing of the quantity: a map is asked for")
put("picoscope_named_de.csv", "Zeit;Drehzahl;Spindelleistung;Strom\n(ms);(1/min);(kW);(mA)\n\n" + "".join(
    f"{r['t'] * 1000},00000000;{comma(r['n'], 8)};{comma(r['p'] / 1000, 8)};{comma(10, 4)}\n" for r in ROWS), "utf-8")
truth("picoscope_named_de.csv", ["n", "p"], start=False)
put("hioki_power.csv", "HIOKI PW3390,Ver 2.10\nFILENAME,0126A000.CSV\n\nDate,Time,Time(ms),Status,Urms1[V],Irms1[A],P1[W]\n" + "".join(
    f"{stamp(r):%Y/%m/%d},{stamp(r):%H:%M:%S},{stamp(r).microsecond // 1000},00000000,{2.301e2:.5E},{1.2:.5E},{r['p']:+.5E}\n" for r in ROWS))
truth("hioki_power.csv", ["p"], note="P1 is the power of the meter: where it is clamped is for the user to say")
put("hioki_logger.csv", "\"File name\",\"WAVE0001.CSV\",\"V 1.00\"\n\"Title comment\",\"\"\n\"Trigger Time\",\"'26-11-26 14:03:01\"\n\"Ch\",\"Mode\",\"Range\",\"Comment\",\"Scaling\",\"Ratio\",\"Offset\"\n\"CH-1\",\"Voltage\",\"10V\",\"Spindle power\",\"On\",\"1\",\"0\"\n\"CH-2\",\"Revolve\",\"5000r/s\",\"Spindle speed\",\"Off\",\"-\",\"-\"\n\"Time\",\"Spindle power[W]\",\"Spindle speed[r/s]\",\"Event\",\n" + "".join(
    f"{r['t']:.9E}, {r['p']:.5E}, {r['n'] / 60:.7E},0,\n" for r in ROWS), "cp932")
truth("hioki_logger.csv", ["n", "p"], start=False)
put("yokogawa.csv", "\"CH/TAG\",\"Spindle speed\",\"Spindle power\"\n\"UNIT\",\"rpm\",\"kW\"\n" + "".join(
    f"{stamp(r):%Y/%m/%d %H:%M:%S}, {r['n']}.0, {r['p'] / 1000:.4f}\n" for r in ROWS))
truth("yokogawa.csv", ["n", "p"], note="no name over the time; whole seconds")
put("fluke.txt", "Datum/Zeit\tSpindelleistung [kW]\tDrehzahl [U/min]\n" + "".join(
    f"{stamp(r):%d.%m.%y %H:%M:%S}\t{comma(r['p'] / 1000, 4)}\t{r['n']}\n" for r in ROWS), "utf-16")
truth("fluke.txt", ["n", "p"], note="two digits of the year, whole seconds")

# ---- drives and controls
put("siemens_trace.csv", "Name;Trace_1\nZeitstempel;26.11.2026 14:03:01,250\nAbtastzeit;1000 ms\n\nZeit [ms];/Nck/!SD/nckServoDataActVelMot64 [u1,4] [U/min];/Nck/!SD/nckServoDataActPower64 [u1,4] [kW]\n" + "".join(
    f"{r['t'] * 1000};{comma(r['n'], 3)};{comma(r['p'] / 1000, 6)}\n" for r in ROWS))
truth("siemens_trace.csv", ["n", "p"], start=False)
put("sinumerik_power_on.csv", "Time since power-on [ms],Spindle speed [rpm],Spindle power [W],Spindle load [%]\n" + "".join(
    f"{86_400_000 * 3 + r['t'] * 1000},{r['n']},{r['p']},{r['p'] / 100:.2f}\n" for r in ROWS))
truth("sinumerik_power_on.csv", ["n", "p"], start=False)
put("servo_guide.csv", "FANUC SERVO GUIDE\nDate,2026/11/26 14:03:01\nSampling,1 s\n,CH1,CH2,CH3\nKind,SPEED,TCMD,POWER\nAxis,S1,S1,S1\nUnit,min-1,%,W\nTime(s),SPEED(S1),TCMD(S1),POWER(S1)\n" + "".join(
    f"{r['t']:.6f},{r['n']:.1f},{r['p'] / 100:.3f},{r['p']:.2f}\n" for r in ROWS), "cp932")
truth("servo_guide.csv", ["n", "p"], start=False)
text = "Name\tScope Project\t\nFile\tC:\\scope.svdx\t\nStarttime of export\t134087797812500000\t\nEndtime of export\t134087804182500000\t\n\nName\tspindle_speed_rpm\tName\tspindle_power_w\nSymbolName\tMAIN.n\tSymbolName\tMAIN.p\nData-Type\tREAL64\tData-Type\tREAL64\nSampleTime[ms]\t1000\tSampleTime[ms]\t500\n\n"
for k in range(len(ROWS) * 2):
    left = f"{k * 1000}\t{ROWS[k]['n']}" if k < len(ROWS) else "\t"
    text += f"{left}\t{k * 500}\t{ROWS[k // 2]['p']}\n"
put("twincat_two_rates.csv", text)
truth("twincat_two_rates.csv", ["n", "p"], start=False, note="two clocks of two rates; the power stands twice")
put("uaexpert_long.csv", "Timestamp,Name,Value\n" + "".join(
    f"{(stamp(r) - dt.timedelta(hours=1)).isoformat(timespec='milliseconds')}Z,{name},{r[key]}\n" for r in ROWS for name, key in [("spindle_speed_rpm", "n"), ("spindle_power_w", "p"), ("engaged", "engaged"), ("coolant_on", "coolant")]))
truth("uaexpert_long.csv", ["n", "engaged", "coolant", "p"], note="one line for each value")
put("heidenhain.csv", "Zeit[s];Spindeldrehzahl[1/s];Spindelleistung[W];Vorschub[m/min]\n" + "".join(
    f"{r['t']};{comma(round(r['n'] / 60, 7))};{comma(r['p'])};{comma(round(r['vf'] / 1000, 6))}\n" for r in ROWS), newline="\n")
truth("heidenhain.csv", ["n", "vf", "p"], start=False)
xml = '<?xml version="1.0" encoding="UTF-8"?>\n<MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.8"><Header instanceId="1" version="1.8.0"/><Streams><DeviceStream name="M1" uuid="u1">\n'
samples = lambda tag, item, key, kind="": "".join(
    f'<{tag} dataItemId="{item}" timestamp="{(stamp(r) - dt.timedelta(hours=1)).isoformat(timespec="milliseconds")}Z" sequence="{r["t"]}"{kind}>{"UNAVAILABLE" if r["t"] == 300 and key == "n" else r[key]}</{tag}>\n' for r in ROWS)
xml += '<ComponentStream component="Rotary" name="S" componentId="s"><Samples>\n' + samples("RotaryVelocity", "s_rpm", "n", ' subType="ACTUAL"') + samples("Wattage", "s_pow", "p") + "</Samples></ComponentStream>\n"
xml += '<ComponentStream component="Path" name="P" componentId="p"><Samples>\n' + samples("PathFeedrate", "p_f", "vf", ' subType="ACTUAL"') + "</Samples><Events>" + '<Execution dataItemId="exec" timestamp="2026-11-26T13:03:01.250Z" sequence="1">ACTIVE</Execution>' + "</Events></ComponentStream></DeviceStream></Streams></MTConnectStreams>\n"
put("mtconnect_sample.xml", xml.replace('">20', '">20'), newline="\n")
truth("mtconnect_sample.xml", ["n", "p"], note="feed of PathFeedrate is mm/s by the standard: 60 times the number")
put("influx.csv", "name,tags,time,spindle_speed_rpm,spindle_power_w\n" + "".join(
    f"machine,host=a,{int((stamp(r) - dt.timedelta(hours=1)).replace(tzinfo=dt.timezone.utc).timestamp() * 1000) * 1000000},{r['n']},{r['p']}\n" for r in ROWS), newline="\n")
truth("influx.csv", ["n", "p"], note="nanoseconds since 1970")

# ---- data tools
import pandas as pd

frame = pd.DataFrame({name: [r[key] for r in ROWS] for name, key in names.items() if key != "t"},
                     index=pd.DatetimeIndex([stamp(r) for r in ROWS]).tz_localize("Europe/Berlin").as_unit("us"))
frame.loc[frame.index[50], "spindle_power_w"] = np.nan
frame.to_csv(f"{OUT}/pandas_index.csv")
truth("pandas_index.csv", COLS[1:], note="one NaN; no name over the index")
frame.to_csv(f"{OUT}/pandas_na.csv.gz", na_rep="NaN", index_label="time_utc", compression=dict(method="gzip", mtime=0))
truth("pandas_na.csv.gz", COLS[1:], note="one NaN")
frame.tz_convert("UTC").tz_localize(None).to_parquet(f"{OUT}/pandas_naive.parquet")
truth("pandas_naive.parquet", COLS[1:], start=False, note="one NaN; the index has no zone and no name")
frame.reset_index(names="Zeit").assign(Zeit=lambda f: f["Zeit"].dt.tz_localize(None)).rename(columns={"spindle_power_w": "Spindelleistung [W]"}).to_excel(f"{OUT}/pandas.xlsx", index=False)
truth("pandas.xlsx", COLS[1:], note="one empty cell")
frame.reset_index(names="t").to_json(f"{OUT}/pandas_lines.json", orient="records", lines=True, date_format="iso")
truth("pandas_lines.json", refused="JSON")
np.savetxt(f"{OUT}/numpy_savetxt.txt", [[r["t"], r["n"], r["p"]] for r in ROWS], header="time_s spindle_speed_rpm spindle_power_w", fmt="%.3f")
truth("numpy_savetxt.txt", ["n", "p"], start=False)

r_script = f'''
d <- read.csv("{OUT}/clean.csv", stringsAsFactors=FALSE)
d$spindle_power_w[51] <- NA
d$coolant_on <- d$coolant_on == 1
d$time_utc <- as.POSIXct(d$time_utc, format="%Y-%m-%dT%H:%M:%OSZ", tz="UTC")
write.csv(d, "{OUT}/r_write_csv.csv")
write.csv2(transform(d, time_utc=format(time_utc, "%Y-%m-%d %H:%M:%OS3")), "{OUT}/r_write_csv2.csv", row.names=FALSE)
write.table(d[, c("spindle_speed_rpm", "engaged", "spindle_power_w")], "{OUT}/r_write_table.txt")
'''
if shutil.which("Rscript"):
    subprocess.run(["Rscript", "-e", r_script], check=True)
    truth("r_write_csv.csv", note="row names; one NA; POSIXct prints whole seconds", start=False)
    truth("r_write_csv2.csv", note="one NA", start=False)
    truth("r_write_table.txt", refused="time", note="no time at all")
if shutil.which("octave-cli") or shutil.which("octave"):
    octave = shutil.which("octave-cli") or shutil.which("octave")
    commands = f'''d = dlmread("{OUT}/numpy_savetxt.txt", " ", 1, 0); time_s = d(:,1); spindle_speed_rpm = d(:,2); spindle_power_w = d(:,3);
save("-v6", "{OUT}/octave_v6.mat", "time_s", "spindle_speed_rpm", "spindle_power_w");
save("-v7", "{OUT}/octave_v7.mat", "time_s", "spindle_speed_rpm", "spindle_power_w");'''
    subprocess.run([octave, "--eval", commands], check=True)
    truth("octave_v6.mat", ["n", "p"], start=False)
    truth("octave_v7.mat", ["n", "p"], start=False)
if shutil.which("soffice"):
    def convert(source, kind, target):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(["soffice", "--headless", "--convert-to", kind, "--outdir", folder, f"{OUT}/{source}"], check=True, stdout=subprocess.DEVNULL)
            shutil.move(f"{folder}/{source.rsplit('.', 1)[0]}.{kind.split(':')[0]}", f"{OUT}/{target}")
    convert("excel_de.xlsx", "ods", "libreoffice.ods")
    truth("libreoffice.ods")
    convert("excel_zh.xlsx", "xls", "libreoffice.xls")
    truth("libreoffice.xls")
    convert("excel_de.xlsx", 'csv:Text - txt - csv (StarCalc):59,34,ANSI,1,,1031,false,true,false', "libreoffice_de.csv")
    truth("libreoffice_de.csv", note="as shown: LibreOffice prints whole seconds")

with open(f"{OUT}/table.json", "w") as file:
    json.dump(TRUTH, file, indent=1, ensure_ascii=False)
print(len(TRUTH), "files")
