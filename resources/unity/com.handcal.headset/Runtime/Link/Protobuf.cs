using System;
using System.Collections.Generic;
using System.Text;

namespace Handcal.Link
{
    /// <summary>A message that no correct peer sends.</summary>
    public sealed class MalformedException : Exception
    {
        public MalformedException(string message) : base(message) { }
    }

    /// <summary>Writes proto3's wire format. Fields are written by number; defaults are left out.</summary>
    public sealed class ProtoWriter
    {
        byte[] bytes = new byte[256];
        int count;

        public byte[] ToArray()
        {
            var exact = new byte[count];
            Buffer.BlockCopy(bytes, 0, exact, 0, count);
            return exact;
        }

        public ProtoWriter Number(int field, ulong value)
        {
            if (value != 0) Tag(field, 0).Varint(value);
            return this;
        }

        public ProtoWriter Flag(int field, bool value)
        {
            return Number(field, value ? 1ul : 0ul);
        }

        public ProtoWriter Fixed(int field, ulong value)
        {
            return value == 0 ? this : Tag(field, 1).LittleEndian(value);
        }

        public ProtoWriter Double(int field, double value)
        {
            return Fixed(field, (ulong)BitConverter.DoubleToInt64Bits(value));
        }

        public ProtoWriter Bytes(int field, byte[] value)
        {
            return value.Length == 0 ? this : Nested(field, value);
        }

        public ProtoWriter Text(int field, string value)
        {
            return Bytes(field, Encoding.UTF8.GetBytes(value));
        }

        public ProtoWriter Doubles(int field, double[] values)
        {
            if (values.Length == 0) return this;
            Tag(field, 2).Varint((ulong)(8 * values.Length));
            foreach (double value in values) LittleEndian((ulong)BitConverter.DoubleToInt64Bits(value));
            return this;
        }

        /// <summary>A message within the message; written even if it is empty.</summary>
        public ProtoWriter Message(int field, ProtoWriter value)
        {
            return Nested(field, value.ToArray());
        }

        ProtoWriter Nested(int field, byte[] value)
        {
            Tag(field, 2).Varint((ulong)value.Length);
            Reserve(value.Length);
            Buffer.BlockCopy(value, 0, bytes, count, value.Length);
            count += value.Length;
            return this;
        }

        ProtoWriter Tag(int field, int wireType)
        {
            Varint((ulong)(field << 3 | wireType));
            return this;
        }

        void Varint(ulong value)
        {
            Reserve(10);
            for (; value > 127; value >>= 7) bytes[count++] = (byte)(value | 128);
            bytes[count++] = (byte)value;
        }

        ProtoWriter LittleEndian(ulong value)
        {
            Reserve(8);
            for (int i = 0; i < 8; i++, value >>= 8) bytes[count++] = (byte)value;
            return this;
        }

        void Reserve(int more)
        {
            if (count + more > bytes.Length)
                Array.Resize(ref bytes, Math.Max(2 * bytes.Length, count + more));
        }
    }

    /// <summary>
    /// Reads proto3's wire format: call <see cref="Next"/>, then the reader of the field's type.
    /// Unknown fields are skipped. Raises MalformedException.
    /// </summary>
    public sealed class ProtoReader
    {
        readonly byte[] bytes;
        readonly int end;
        int at;
        int wireType;
        bool isRead = true;

        public ProtoReader(byte[] bytes, int start, int count)
        {
            this.bytes = bytes;
            at = start;
            end = start + count;
        }

        public ProtoReader(byte[] bytes) : this(bytes, 0, bytes.Length) { }

        /// <summary>Returns false at the end.</summary>
        public bool Next(out int field)
        {
            if (!isRead) Skip();
            field = 0;
            if (at == end) return false;
            ulong tag = Varint();
            field = (int)(tag >> 3);
            wireType = (int)(tag & 7);
            isRead = false;
            if (field == 0 || tag > uint.MaxValue) throw new MalformedException("a field without a number");
            return true;
        }

        public ulong Number()
        {
            Expect(0);
            return Varint();
        }

        public ulong Fixed()
        {
            Expect(1);
            return LittleEndian();
        }

        public double Double()
        {
            return BitConverter.Int64BitsToDouble((long)Fixed());
        }

        public byte[] Bytes()
        {
            ProtoReader part = Message();
            var value = new byte[part.end - part.at];
            Buffer.BlockCopy(bytes, part.at, value, 0, value.Length);
            return value;
        }

        public string Text()
        {
            ProtoReader part = Message();
            try
            {
                return new UTF8Encoding(false, true).GetString(bytes, part.at, part.end - part.at);
            }
            catch (ArgumentException)
            {
                throw new MalformedException("a text that is not UTF-8");
            }
        }

        public ProtoReader Message()
        {
            Expect(2);
            ulong size = Varint();
            if (size > (ulong)(end - at)) throw Truncated();
            var part = new ProtoReader(bytes, at, (int)size);
            at += (int)size;
            return part;
        }

        /// <summary>Adds the doubles of a repeated field, packed or one by one.</summary>
        public void Doubles(List<double> into)
        {
            if (wireType == 1)
            {
                into.Add(Double());
                return;
            }
            ProtoReader part = Message();
            while (part.at < part.end) into.Add(BitConverter.Int64BitsToDouble((long)part.LittleEndian()));
        }

        /// <summary>Adds the numbers of a repeated field, packed or one by one.</summary>
        public void Numbers(List<ulong> into)
        {
            if (wireType == 0)
            {
                into.Add(Number());
                return;
            }
            ProtoReader part = Message();
            while (part.at < part.end) into.Add(part.Varint());
        }

        void Expect(int type)
        {
            if (wireType != type) throw new MalformedException("a field of another type");
            isRead = true;
        }

        void Skip()
        {
            switch (wireType)
            {
                case 0: Number(); break;
                case 1: Fixed(); break;
                case 2: Message(); break;
                case 5:
                    if (end - at < 4) throw Truncated();
                    at += 4;
                    isRead = true;
                    break;
                default: throw new MalformedException("an unknown type of field");
            }
        }

        ulong Varint()
        {
            ulong value = 0;
            for (int shift = 0; shift < 64; shift += 7)
            {
                if (at == end) throw Truncated();
                byte next = bytes[at++];
                value |= (ulong)(next & 127) << shift;
                if (next < 128) return value;
            }
            throw new MalformedException("a number of more than 64 bits");
        }

        ulong LittleEndian()
        {
            if (end - at < 8) throw Truncated();
            ulong value = 0;
            for (int i = 7; i >= 0; i--) value = value << 8 | bytes[at + i];
            at += 8;
            return value;
        }

        static MalformedException Truncated()
        {
            return new MalformedException("a message that ends early");
        }
    }
}
